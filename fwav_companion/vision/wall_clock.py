"""Converts stamps of this board's clocks to host instants. PURE: the shell reads both clocks and passes them in.

CLOCK_REALTIME and CLOCK_MONOTONIC are disciplined alike, so their difference is constant until the wall clock is
stepped (by NTP's first fix after boot, or by a user). A stamp that may be from before a step is rejected, because its
host instant is not known.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs, host_from_seconds, whole_microseconds
from fwav_companion.types import NoFrame, Reason

SMALLEST_STEP_NS = 1_000_000
"""Smallest step that is reported: 1 ms. Two successive readings differ by up to tens of microseconds on a busy slow
board. Smaller steps are followed without a report: they are less than the error of any camera's capture time."""
LONGEST_WAY_NS = NS_PER_S // 2
"""Longest time from capture to arrival: half a second, after which frames are rejected. A stamp from before a step may
arrive until then."""
STEPS_KEPT = 8
"""Number of steps with which each frame is compared; older ones within half a second are ignored."""


class StampClocks(Protocol):
    """Converts stamps to the host clock, live or in a recording."""

    def host_from_unix(self, unix_s: float, arrival_ns: HostNs | None) -> HostNs | NoFrame:
        """The host instant of a frame's ``time_unix``, by its arrival."""

    def host_from_monotonic(self, monotonic_s: float) -> HostNs | NoFrame:
        """The host instant of a ``time_monotonic``."""

    @property
    def boot_is_unix(self) -> bool:
        """Whether the autopilot's clock is known to count from 1970, as that of PX4's simulators does."""


class ClockStep(msgspec.Struct, frozen=True):
    """A step of the wall clock."""

    seen_ns: HostNs
    """First observation after the step, which was between the previous observation and this one."""
    before_ns: int
    """unix - host before the step."""
    after_ns: int
    """unix - host after the step."""

    @property
    def size_s(self) -> float:
        """Size of the step, seconds; positive: forward."""
        return (self.after_ns - self.before_ns) * 1e-9


class WallClock:
    """The wall clock of a live board, ``unix = host + unix_minus_host``, with detection of steps."""

    def __init__(self, host_ns: HostNs, unix_ns: int) -> None:
        """Both clocks at one instant."""
        self.unix_minus_host_ns = unix_ns - host_ns
        self._steps: deque[ClockStep] = deque(maxlen=STEPS_KEPT)

    def observe(self, host_ns: HostNs, unix_ns: int) -> ClockStep | None:
        """Observe both clocks at one instant; the step if the wall clock was set since the last observation."""
        before, self.unix_minus_host_ns = self.unix_minus_host_ns, unix_ns - host_ns
        if abs(self.unix_minus_host_ns - before) < SMALLEST_STEP_NS:
            return None
        step = ClockStep(host_ns, before, self.unix_minus_host_ns)
        self._steps.append(step)
        return step

    def host_from_unix(self, unix_s: float, arrival_ns: HostNs | None) -> HostNs | NoFrame:
        """The host instant by the last observation of the clocks; ACROSS_CLOCK_STEP if it may precede a step."""
        unix_ns = host_from_seconds(unix_s)
        host_ns = whole_microseconds(unix_ns - self.unix_minus_host_ns)
        for step in self._steps:
            if _may_precede(step, unix_ns, host_ns, arrival_ns):
                return NoFrame(Reason.ACROSS_CLOCK_STEP, f"the wall clock was set by {step.size_s:+.3f} s")
        return host_ns

    @property
    def boot_is_unix(self) -> bool:
        """False: it is not known in flight."""
        return False

    def host_from_monotonic(self, monotonic_s: float) -> HostNs | NoFrame:
        """The same instant: CLOCK_MONOTONIC is the host clock."""
        return host_from_seconds(monotonic_s)


def _may_precede(step: ClockStep, unix_ns: int, host_ns: int, arrival_ns: HostNs | None) -> bool:
    """Whether a stamp that is ``host_ns`` by the present clock may have been taken before the step."""
    if host_ns < step.seen_ns:
        return True
    if arrival_ns is None or arrival_ns - step.seen_ns > LONGEST_WAY_NS:
        return False
    by_old_clock_ns = unix_ns - step.before_ns
    return step.seen_ns - LONGEST_WAY_NS <= by_old_clock_ns <= step.seen_ns


class RecordingClock:
    """Clocks of a recording: ``time_unix`` has a fixed offset from its host clock; CLOCK_MONOTONIC is unknown."""

    def __init__(self, unix_minus_host_ns: int = 0, *, boot_is_unix: bool = False) -> None:
        self._unix_minus_host_ns = unix_minus_host_ns
        self.boot_is_unix = boot_is_unix

    def host_from_unix(self, unix_s: float, arrival_ns: HostNs | None) -> HostNs | NoFrame:  # noqa: ARG002
        """The stamp on the recording's host clock."""
        return HostNs(host_from_seconds(unix_s) - self._unix_minus_host_ns)

    def host_from_monotonic(self, monotonic_s: float) -> HostNs | NoFrame:  # noqa: ARG002
        """Always NO_MONOTONIC_MAP."""
        return NoFrame(Reason.NO_MONOTONIC_MAP)
