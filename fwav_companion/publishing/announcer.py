"""What people are told in words: a target found, a target lost, each with its place and how well that is known."""

from __future__ import annotations

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.publishing import enums
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.selection import successor
from fwav_companion.publishing.statustext import statustexts
from fwav_companion.publishing.target_report import target_report
from fwav_companion.types.messages import Notice, Outgoing, Severity
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track, TrackState

BURST = 4
"""Texts in a row; then one a second. A field full of targets must not fill the radio with words."""
REFILL_NS = NS_PER_S
REPEATED_NS = 10 * NS_PER_S
"""The same line is not said again within this."""
MAX_REMEMBERED = 32
SEVERITIES = {
    Severity.INFO: enums.MAV_SEVERITY_INFO,
    Severity.WARNING: enums.MAV_SEVERITY_WARNING,
    Severity.ERROR: enums.MAV_SEVERITY_ERROR,
}


class Announcer:
    """Turns the lives of tracks, and notices, into STATUSTEXT."""

    def __init__(self, options: PublishOptions):
        self._options = options
        self._found: dict[int, Track] = {}
        self._tokens = BURST
        self._refilled_ns: HostNs | None = None
        self._unsaid = 0
        self._number = 0
        self._said_ns: dict[str, HostNs] = {}

    def on_tracks(self, tracks: tuple[Track, ...], situation: Situation) -> list[Outgoing]:
        """Tell of every track that is newly believed, and of every believed one that ended, or proved to be another."""
        texts = []
        live = {track.id: track for track in tracks if track.state is not TrackState.DROPPED}
        for track in live.values():
            if track.state is TrackState.CONFIRMED:
                if track.id not in self._found:
                    texts.append(_sentence("found", track, situation))
                self._found[track.id] = track
        dropped = {track.id: track for track in tracks if track.state is TrackState.DROPPED}
        for number in [number for number in self._found if number not in live]:
            known = self._found.pop(number)
            same = successor(number, live.values())
            if same is None:
                texts.append(_sentence("lost", dropped.get(number, known), situation))
            else:
                texts.append(_sentence(f"{_name(known)} is", live[same], situation))
        return [out for text in texts for out in self._say(text, enums.MAV_SEVERITY_NOTICE, situation.now_ns)]

    def on_notice(self, notice: Notice, now: HostNs) -> list[Outgoing]:
        """Say a notice that is meant for the ground, once in ten seconds."""
        said_ns = self._said_ns.get(notice.text)
        if not notice.to_ground or (said_ns is not None and now < said_ns + REPEATED_NS):
            return []
        self._said_ns.pop(notice.text, None)
        if len(self._said_ns) >= MAX_REMEMBERED:
            del self._said_ns[next(iter(self._said_ns))]
        self._said_ns[notice.text] = now
        return self._say(notice.text, SEVERITIES[notice.severity], now)

    def _say(self, text: str, severity: int, now: HostNs) -> list[Outgoing]:
        if not self._options.statustext:
            return []
        self._refill(now)
        if self._tokens == 0 and severity > enums.MAV_SEVERITY_ERROR:
            self._unsaid += 1
            return []
        self._tokens = max(0, self._tokens - 1)
        if self._unsaid:
            text, self._unsaid = f"{text} (+{self._unsaid} more)", 0
        self._number += 1
        return statustexts(text, severity, component=self._options.companion_component, number=self._number)

    def _refill(self, now: HostNs) -> None:
        if self._refilled_ns is None:
            self._refilled_ns = now
        earned = max(0, now - self._refilled_ns) // REFILL_NS
        self._tokens = min(BURST, self._tokens + earned)
        self._refilled_ns = HostNs(self._refilled_ns + earned * REFILL_NS)


def _sentence(what: str, track: Track, situation: Situation) -> str:
    """As ``found person 3: 47.397742, 8.545594 +-0.8 m``: six decimals are 0.1 m, one sigma of the larger axis."""
    target = target_report(track, situation)
    accuracy = f"+-{target.horizontal_sigma_m:.1f} m"
    if target.place is not None:
        where = f"{target.place.lat_deg:.6f}, {target.place.lon_deg:.6f} {accuracy}"
    else:
        north, east, _ = target.position_ned
        where = f"{_offset(north, 'N', 'S')} {_offset(east, 'E', 'W')} of vehicle {accuracy}"
    reason = f" ({track.reason})" if track.reason is not None else ""
    return f"{what} {_name(track)}: {where}{reason}"


def _name(track: Track) -> str:
    return f"{track.label or 'target'} {track.id}"


def _offset(metres: float, positive: str, negative: str) -> str:
    return f"{abs(metres):.1f} m {positive if metres >= 0.0 else negative}"
