"""SHELL: keeps the signing timestamp across restarts, because receivers reject a timestamp that goes back.

The file has a reservation: this run uses only timestamps below it. It is extended before it is reached, first by a
tenth of a second, then by an eighth of the time since the start, and at most by a minute. So the timestamps of a
service that crashes again and again are ahead by less than its running time. A clean stop stores the last used one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgspec

from fwav_companion.config import Config
from fwav_companion.errors import ImplausibleStateError
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.mavlink.wire.signing import (
    LATEST_PLAUSIBLE,
    UNITS_PER_S,
    YEAR,
    SigningClock,
    starting_timestamp,
    timestamp_from_unix_ns,
)
from fwav_companion.service.kept_state import read_state
from fwav_companion.service.latest_file import LatestFile, state_path
from fwav_companion.types import Message, Notice, NoticeCode, Severity

NAME = "signing.json"
NOT_KEPT = "the signing time is not kept: set [state] directory or $STATE_DIRECTORY"
LEAST_RESERVED_S = 0.1
MOST_RESERVED_S = 60.0
"""Longest reservation, seconds: the MAVLink guide asks for a write once a minute."""
RESERVED_SHARE = 1.0 / 8.0
FRAMES = 10_000
"""Timestamps that are reserved in addition for the frames of a second: each takes one."""
AHEAD_S = 60.0
"""Lead over UTC, seconds, from which peers that sign by the clock are refused as too old (MAVLink guide)."""
PLAUSIBLE_UNIX_US = 1_577_836_800_000_000
"""Least plausible time, the year 2020: a receiver without time reports 1970 or 1980."""
UTC_TICKS = 10
"""Interval of the checks whether the wall clock is synchronised, in seconds."""


class SigningStore:
    """Reads the timestamp at the start and extends the reservation, if there is a state directory."""

    def __init__(self, config: Config, on_failure: Callable[[str], None], is_synchronised: Callable[[], bool]) -> None:
        """``is_synchronised``: whether the wall clock is."""
        configured = config.state.directory
        self._path: Path | None = None
        self._signs = config.signing is not None
        if self._signs:
            self._path = state_path(config.resolve(configured) if configured else None, NAME)
        self._warning = "" if not self._signs or self._path is not None else NOT_KEPT
        self._on_failure = on_failure
        self._is_synchronised = is_synchronised
        self._file = None if self._path is None else LatestFile([self._path], on_failure, outlives_us=True)
        self._clock: SigningClock | None = None
        self._started_ns = HostNs(0)
        self._ticks = 0
        self._reported = False

    def starting_timestamp(self, unix_ns: int) -> int:
        """First timestamp of this run's signatures."""
        if not self._signs:
            return 0
        synchronised = self._is_synchronised()
        return starting_timestamp(self._kept(unix_ns, synchronised=synchronised), unix_ns, synchronised=synchronised)

    def start(self) -> None:
        """Start the writer; warn if there is no directory for it."""
        if self._warning:
            self._on_failure(self._warning)
        if self._file is not None:
            self._file.start()

    def begin(self, clock: SigningClock | None, now: HostNs) -> None:
        """Reserve the first timestamps before one is used."""
        self._clock, self._started_ns = clock, now
        self._reserve(now)

    def tick(self, now: HostNs, unix_ns: int) -> list[Notice]:
        """Follow a synchronised wall clock and extend the reservation, once a second. Returns what to report."""
        if self._clock is None:
            return []
        if self._ticks % UTC_TICKS == 0 and self._is_synchronised():
            self._clock.follow(unix_ns, now)
        self._ticks += 1
        self._reserve(now)
        ahead_s = self._clock.ahead_s(now)
        if ahead_s <= AHEAD_S or self._reported:
            return []
        self._reported = True
        text = f"signing time is {ahead_s:.0f} s ahead of UTC, peers that sign by the clock are refused: set a new key"
        return [Notice(NoticeCode.SIGNING_AHEAD, Severity.WARNING, text, to_ground=True)]

    def on_message(self, message: Message, autopilot: tuple[int, int] | None, now: HostNs) -> None:
        """Follow the time of the autopilot's signed SYSTEM_TIME."""
        if self._clock is None or not message.signed or message.name != "SYSTEM_TIME":
            return
        unix_us = int(message.fields.time_unix_usec)
        plausible = unix_us > PLAUSIBLE_UNIX_US and timestamp_from_unix_ns(unix_us * 1000) > 0
        if (message.system, message.component) == autopilot and plausible:
            self._clock.follow(unix_us * 1000, now)

    def close(self, timeout_s: float) -> None:
        """Store the last used timestamp, and stop the writer."""
        if self._file is not None:
            if self._clock is not None:
                self._file.write(msgspec.json.encode(self._clock.timestamp))
            self._file.close(timeout_s)

    def _reserve(self, now: HostNs) -> None:
        """Extend the reservation when more than half of it is used."""
        clock = self._clock
        if self._file is None or clock is None:
            return
        up_s = s_from_ns(now - self._started_ns)
        ahead = round(UNITS_PER_S * min(max(RESERVED_SHARE * up_s, LEAST_RESERVED_S), MOST_RESERVED_S))
        if self._ticks == 0 or clock.timestamp + ahead // 2 > clock.limit:
            clock.limit = clock.timestamp + ahead
            self._file.write(msgspec.json.encode(clock.limit + FRAMES))

    def _kept(self, unix_ns: int, *, synchronised: bool) -> int | None:
        """Timestamp below which earlier runs stayed; None if the wall clock is the best that is known.

        Of a file that cannot be used, the time of its last change remains: an earlier run was active then.
        """
        if self._path is None:
            return None
        try:
            changed_unix_ns = self._path.stat().st_mtime_ns
        except OSError:  # the first run
            return None
        latest = timestamp_from_unix_ns(unix_ns) + YEAR if synchronised else LATEST_PLAUSIBLE
        kept = read_state(self._path, partial(_plausible, latest=min(latest, LATEST_PLAUSIBLE)), self._unusable)
        changed = timestamp_from_unix_ns(changed_unix_ns)
        return kept if kept is not None or synchronised else max(changed, timestamp_from_unix_ns(unix_ns))

    def _unusable(self, text: str) -> None:
        self._on_failure(f"{text}. Signatures start at the present time: if peers refuse them, set a new key")


def _plausible(content: bytes, latest: int) -> int:
    """The kept timestamp. ImplausibleStateError if it is not later than 2015, or later than ``latest``."""
    timestamp = msgspec.json.decode(content, type=int)
    if not 0 < timestamp <= latest:
        raise ImplausibleStateError(f"signing time {timestamp}; accepted: 1 to {latest} (10 us since 2015)")
    return timestamp
