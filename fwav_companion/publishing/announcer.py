"""Notices for people: target found, lost, merged, each with place and accuracy; and notices as STATUSTEXT. Pure.

STATUSTEXT (253) carries 50 bytes; a longer text is sent in chunks. A receiver takes a chunk with a zero byte as the
last one. Therefore every chunk except the last fills its 50 bytes, and the last does not. A character that would be cut
in two goes to the next chunk, and spaces fill the gap.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import filterfalse

from fwav_companion.geometry.ellipses import radius_95
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.publishing import enums
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.selection import successor
from fwav_companion.publishing.target_report import target_report
from fwav_companion.types.messages import Destination, Notice, NoticeCode, Outgoing, Severity
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track, TrackState

BURST = 4
"""Most texts in a burst; then one a second is sent. A field full of targets must not fill the radio with texts."""
REFILL_NS = NS_PER_S
REPEATED_NS = 10 * NS_PER_S
"""Time within which an identical text is not sent again."""
MAX_REMEMBERED = 32
CHUNK_BYTES = 50
MAX_BYTES = 4 * CHUNK_BYTES
"""Length at which texts are cut: on a radio, texts take the place of telemetry."""
ALONE = 0
"""Id of a text that fits into one message."""
ID_MODULUS = 0xFFFF
SEVERITIES = {
    Severity.INFO: enums.MAV_SEVERITY_INFO,
    Severity.NOTICE: enums.MAV_SEVERITY_NOTICE,
    Severity.WARNING: enums.MAV_SEVERITY_WARNING,
    Severity.ERROR: enums.MAV_SEVERITY_ERROR,
}


class TargetNotices:
    """Turns the states of tracks into notices, each once: found, lost, merged."""

    def __init__(self) -> None:
        self._found: dict[int, Track] = {}

    def forget(self) -> None:
        """Forget every target without a notice: all tracks ended, and another notice gives the reason."""
        self._found.clear()

    def on_tracks(self, tracks: tuple[Track, ...], situation: Situation) -> list[Notice]:
        """Notices for the tracks that were confirmed, ended, or merged with this frame."""
        notices = []
        live = {track.id: track for track in tracks if track.state is not TrackState.DROPPED}
        for track in live.values():
            if track.state is TrackState.CONFIRMED:
                if track.id not in self._found:
                    text = f"found {_name(track)}: {_place(track, situation)}"
                    notices.append(_notice(NoticeCode.TARGET_FOUND, text))
                self._found[track.id] = track
        for number in list(filterfalse(live.__contains__, self._found)):
            known = self._found.pop(number)
            same = successor(number, live.values())
            if same is None:
                ended = next((track for track in tracks if track.id == number), known)
                notices.append(_lost(ended, situation))
            else:
                text = f"{_name(known)} is {_name(live[same])}: {_place(live[same], situation)}"
                notices.append(_notice(NoticeCode.TARGET_MERGED, text))
        return notices


class Announcer:
    """Encodes notices for the ground as STATUSTEXT, limited in rate."""

    def __init__(self, options: PublishOptions):
        self._options = options
        self._tokens = BURST
        self._refilled_ns: HostNs | None = None
        self._unsent = 0
        self._number = 0
        self._sent_ns: dict[str, HostNs] = {}

    def on_notice(self, notice: Notice, now: HostNs) -> list[Outgoing]:
        """STATUSTEXT messages of a notice that is meant for the ground; the same text at most once in ten seconds."""
        sent_ns = self._sent_ns.get(notice.text)
        if not notice.to_ground or (sent_ns is not None and now < sent_ns + REPEATED_NS):
            return []
        self._sent_ns.pop(notice.text, None)
        if len(self._sent_ns) >= MAX_REMEMBERED:
            del self._sent_ns[next(iter(self._sent_ns))]
        self._sent_ns[notice.text] = now
        return self._send(notice, now)

    def _send(self, notice: Notice, now: HostNs) -> list[Outgoing]:
        if not self._options.statustext:
            return []
        self._refill(now)
        if self._tokens == 0 and notice.severity is not Severity.ERROR:
            self._unsent += 1
            return []
        self._tokens = max(0, self._tokens - 1)
        text = notice.text
        if self._unsent:
            text, self._unsent = f"{text} (+{self._unsent} more)", 0
        self._number += 1
        return statustexts(
            text,
            SEVERITIES[notice.severity],
            code=notice.code,
            component=self._options.companion_component,
            number=self._number,
        )

    def _refill(self, now: HostNs) -> None:
        if self._refilled_ns is None:
            self._refilled_ns = now
        earned = max(0, now - self._refilled_ns) // REFILL_NS
        self._tokens = min(BURST, self._tokens + earned)
        self._refilled_ns = HostNs(self._refilled_ns + earned * REFILL_NS)


def statustexts(
    text: str,
    severity: int,
    *,
    code: NoticeCode,
    component: int,
    number: int = 1,
    to: Destination = Destination.GROUND,
    link: str = "",
) -> list[Outgoing]:
    """STATUSTEXT messages of one text. ``number`` counts the sender's texts: receivers join chunks by it."""
    encoded = _printable(text).encode(errors="replace")
    if len(encoded) <= CHUNK_BYTES:
        chunks, identity = [encoded.decode()], ALONE
    else:
        chunks, identity = list(_chunks(encoded[:MAX_BYTES])), 1 + number % ID_MODULUS
    return [
        Outgoing(
            name="STATUSTEXT",
            fields={"severity": severity, "text": chunk, "id": identity, "chunk_seq": sequence},
            to=to,
            component=component,
            link=link,
            notice=code,
        )
        for sequence, chunk in enumerate(chunks)
    ]


def _notice(code: NoticeCode, text: str) -> Notice:
    return Notice(code, Severity.NOTICE, text, to_ground=True)


def _lost(track: Track, situation: Situation) -> Notice:
    reason = f" ({track.reason.value.replace('_', ' ')})" if track.reason is not None else ""
    text = f"lost {_name(track)}{reason}: last at {_place(track, situation)}"
    return _notice(NoticeCode.TARGET_LOST, text)


def _place(track: Track, situation: Situation) -> str:
    """Place and 95 % radius, as ``47.397742, 8.545594, 95 % within 2.4 m``; six decimals are 0.1 m."""
    target = target_report(track, situation)
    accuracy = f"95 % within {radius_95(track.cov):.1f} m"
    if target.place is not None:
        return f"{target.place.lat_deg:.6f}, {target.place.lon_deg:.6f}, {accuracy}"
    north, east, _ = target.from_vehicle or target.position_ned
    return f"{_offset(north, 'N', 'S')} {_offset(east, 'E', 'W')} of vehicle, {accuracy}"


def _name(track: Track) -> str:
    return f"{track.label or 'target'} {track.id}"


def _offset(metres: float, positive: str, negative: str) -> str:
    return f"{abs(metres):.1f} m {positive if metres >= 0.0 else negative}"


def _chunks(encoded: bytes) -> Iterator[str]:
    while len(encoded) >= CHUNK_BYTES:
        whole = encoded[:CHUNK_BYTES].decode(errors="ignore")
        size = len(whole.encode())
        yield whole + " " * (CHUNK_BYTES - size)
        encoded = encoded[size:]
    yield encoded.decode(errors="ignore")


def _printable(text: str) -> str:
    """The text with control characters replaced by spaces: a zero byte would end the text, a line break the line."""
    return "".join(character if character.isprintable() else " " for character in text)
