"""Signs our frames and verifies received ones (MAVLink guide, message_signing).

The hash is checked before the timestamp is used. pymavlink 2.4.50 stores a stream's timestamp first, so that one forged
frame from the far future locks out every genuine one; here such a frame has no effect.
"""

from __future__ import annotations

from enum import StrEnum
from hashlib import sha256
from hmac import compare_digest
from typing import Final

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.wire.frames import SIGNATURE_LENGTH

_TICK_NS: Final = 10_000
"""Unit of a timestamp: 10 us, counted since 2015-01-01 UTC."""
_EPOCH_UNIX_S: Final = 1_420_070_400
UNITS_PER_S: Final = 100_000
_MINUTE: Final = 6_000_000
"""A minute in these units: a new stream may be this far behind our own timestamp (MAVLink guide)."""
_GREATEST: Final = (1 << 48) - 1
_HASH_LENGTH: Final = 6
MAX_STREAMS: Final = 256
"""Most streams that are remembered, because every relayed frame is verified: 64 senders with four links each (the C
library has 16). Only senders with the key can fill the table. Streams more than a minute behind are removed to make
room: the rule for new streams rejects their replays too."""


LATEST_PLAUSIBLE: Final = _GREATEST - 10 * 365 * 86_400 * UNITS_PER_S
"""Ten years below the last timestamp, in 2094. A later one would soon leave none that is newer, and each receiver that
has heard it refuses all earlier ones."""
YEAR: Final = 365 * 86_400 * UNITS_PER_S
"""A year in units of a timestamp."""


def timestamp_from_unix_ns(unix_ns: int) -> int:
    """Return the time of a wall clock in signing units; 0 before 2015, and where it is later than plausible: of a
    battery-backed clock that lost its time, or of a receiver of satellites that was deceived.
    """
    timestamp = max(0, (unix_ns - _EPOCH_UNIX_S * 1_000_000_000) // _TICK_NS)
    return timestamp if timestamp <= LATEST_PLAUSIBLE else 0


def starting_timestamp(reserved: int | None, unix_ns: int, *, synchronised: bool) -> int:
    """Return the timestamp after a restart: greater than any that an earlier run used.

    ``reserved``: timestamp below which earlier runs stayed; None if it was not kept. An unsynchronised wall clock
    counts only in that case: if it is ahead of the true time, the timestamps stay ahead permanently.
    """
    wall = timestamp_from_unix_ns(unix_ns)
    if reserved is None:
        return wall
    return max(reserved + 1, wall) if synchronised else reserved + 1


class SigningClock:
    """Timestamp that all our links share. It only grows: with each frame, to the timestamps of genuine peers, and with
    time.

    Time is UTC as soon as it is known (:meth:`follow`). A timestamp that is ahead of UTC, because an earlier run
    reserved it or a peer is ahead, waits until UTC has caught up. Meanwhile it grows by one with each frame, as MAVLink
    requires. Without UTC it grows with host time from the start.
    """

    def __init__(self, timestamp: int) -> None:
        """Start at a timestamp from :func:`starting_timestamp`."""
        self._timestamp = min(timestamp, _GREATEST)
        self._reference: tuple[int, HostNs] | None = None
        """(timestamp, host instant) from which time counts."""
        self._knows_utc = False
        self.limit = _GREATEST
        """Largest timestamp by the passage of time: the reservation of this run."""

    @property
    def timestamp(self) -> int:
        """Current timestamp: all used timestamps are lower."""
        return self._timestamp

    def follow(self, unix_ns: int, now: HostNs) -> None:
        """Set UTC at an instant, from a synchronised wall clock or from the autopilot's signed time."""
        self._reference = (timestamp_from_unix_ns(unix_ns), now)
        self._knows_utc = True

    def ahead_s(self, now: HostNs) -> float:
        """Return the lead of the timestamp over UTC, seconds; 0 while UTC is not known."""
        if not self._knows_utc or self._reference is None:
            return 0.0
        return max(0.0, (self._timestamp - self._at(self._reference, now)) / UNITS_PER_S)

    def tick(self, now: HostNs) -> int:
        """Advance with time, and return the timestamp."""
        if self._reference is None:
            self._reference = (self._timestamp, now)
        elif not self._knows_utc and self._timestamp > self._at(self._reference, now) + UNITS_PER_S:
            self._reference = (self._timestamp, now)  # a peer was ahead: time continues from its timestamp
        carried = min(self._at(self._reference, now), self.limit, _GREATEST)
        self._timestamp = max(self._timestamp, carried)
        return self._timestamp

    def next(self, now: HostNs) -> int:
        """Return the timestamp of one frame: no two frames have the same."""
        timestamp = self.tick(now)
        if timestamp < _GREATEST:
            self._timestamp = timestamp + 1
        return timestamp

    def learn(self, timestamp: int) -> None:
        """Advance to the timestamp of a genuine peer. An older one changes nothing."""
        self._timestamp = max(self._timestamp, min(timestamp, _GREATEST))

    def _at(self, reference: tuple[int, HostNs], now: HostNs) -> int:
        return reference[0] + (now - reference[1]) // _TICK_NS


class Signer:
    """Signs the frames that leave by one link."""

    def __init__(self, key: bytes, link_id: int, clock: SigningClock) -> None:
        """Start without a signed frame. ``link_id``: 0..255, unique per link, because it separates the streams."""
        self._hash = sha256(key)
        self._link_id = link_id
        self._clock = clock

    def sign(self, frame: bytes, now: HostNs) -> bytes:
        """Return the frame, which was encoded with FLAG_SIGNED, with its 13 bytes of signature."""
        stamped = frame + (self._link_id | self._clock.next(now) << 8).to_bytes(7, "little")
        digest = self._hash.copy()
        digest.update(stamped)
        return stamped + digest.digest()[:_HASH_LENGTH]


class Signature(StrEnum):
    """Result of verifying a signature."""

    GENUINE = "genuine"
    FORGED = "forged"
    """Not made with our key, or the frame was altered."""
    REPLAYED = "replayed"
    """Genuine, but not newer than the newest frame of its stream."""
    OUTDATED = "outdated"
    """The first of its stream, and more than a minute behind our own timestamp."""
    TOO_MANY_STREAMS = "too_many_streams"


class Verifier:
    """Distinguishes genuine frames from forged and replayed ones, over all links."""

    def __init__(self, key: bytes, clock: SigningClock) -> None:
        self._hash = sha256(key)
        self._clock = clock
        self._streams: dict[tuple[int, int, int], int] = {}
        """Newest timestamp by (system, component, link id)."""

    def verify(self, frame: bytes, system: int, component: int, now: HostNs) -> Signature:
        """Return whether the signature is genuine. ``frame``: all its bytes, the last 13 its signature. Only a genuine
        one is remembered.
        """
        digest = self._hash.copy()
        digest.update(frame[:-_HASH_LENGTH])
        if not compare_digest(digest.digest()[:_HASH_LENGTH], frame[-_HASH_LENGTH:]):
            return Signature.FORGED
        timestamp = int.from_bytes(frame[-SIGNATURE_LENGTH + 1 : -_HASH_LENGTH], "little")
        stream = (system, component, frame[-SIGNATURE_LENGTH])
        newest = self._streams.get(stream)
        if newest is None:
            refusal = self._refuse_new_stream(timestamp, now)
            if refusal is not None:
                return refusal
        elif timestamp <= newest:
            return Signature.REPLAYED
        self._streams[stream] = timestamp
        self._clock.learn(timestamp)
        return Signature.GENUINE

    def _refuse_new_stream(self, timestamp: int, now: HostNs) -> Signature | None:
        oldest_allowed = self._clock.tick(now) - _MINUTE
        if timestamp < oldest_allowed:
            return Signature.OUTDATED
        if len(self._streams) >= MAX_STREAMS:
            self._streams = {stream: newest for stream, newest in self._streams.items() if newest >= oldest_allowed}
        return Signature.TOO_MANY_STREAMS if len(self._streams) >= MAX_STREAMS else None
