"""Stamps of this board's clocks to host instants. PURE: both clocks are read by the shell and handed in.

CLOCK_REALTIME and CLOCK_MONOTONIC are disciplined alike, so their difference is constant until somebody steps the wall
clock (NTP's first fix after boot, a user). A stamp that may be from before a step cannot be placed, and is refused.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs, host_from_seconds, whole_microseconds
from fwav_companion.types import NoFrame, Reason

SMALLEST_STEP_NS = 1_000_000
"""1 ms: reading two clocks one after the other differs by up to tens of microseconds on a busy slow board; what is
smaller than this is followed without a word, as it moves a capture by less than any camera knows it."""
LONGEST_WAY_NS = NS_PER_S // 2
"""Frames are taken up to half a second after their capture: so long may a stamp from before a step still arrive."""
STEPS_KEPT = 8
"""More steps than this within half a second are not followed: each frame is then compared with the newest ones."""


class StampClocks(Protocol):
    """Places stamps on the host's clock, live or in a recording."""

    def host_from_unix(self, unix_s: float, arrival_ns: HostNs | None) -> HostNs | NoFrame:
        """The host instant of a ``time_unix`` in a frame that arrived then."""

    def host_from_monotonic(self, monotonic_s: float) -> HostNs | NoFrame:
        """The host instant of a ``time_monotonic``."""


class ClockStep(msgspec.Struct, frozen=True):
    """The wall clock was set."""

    seen_ns: HostNs
    """When it was first seen stepped; it stepped at some time before, after the observation before."""
    before_ns: int
    """unix - host until then."""
    after_ns: int
    """unix - host since."""

    @property
    def size_s(self) -> float:
        """How far it went, seconds; positive: forward."""
        return (self.after_ns - self.before_ns) * 1e-9


class WallClock:
    """The live board: ``unix = host + unix_minus_host``, watched for steps."""

    def __init__(self, host_ns: HostNs, unix_ns: int) -> None:
        """Both clocks, read at one instant."""
        self.unix_minus_host_ns = unix_ns - host_ns
        self._steps: deque[ClockStep] = deque(maxlen=STEPS_KEPT)

    def observe(self, host_ns: HostNs, unix_ns: int) -> ClockStep | None:
        """Both clocks, read at one instant; the step if the wall clock was set since the last time."""
        before, self.unix_minus_host_ns = self.unix_minus_host_ns, unix_ns - host_ns
        if abs(self.unix_minus_host_ns - before) < SMALLEST_STEP_NS:
            return None
        step = ClockStep(host_ns, before, self.unix_minus_host_ns)
        self._steps.append(step)
        return step

    def host_from_unix(self, unix_s: float, arrival_ns: HostNs | None) -> HostNs | NoFrame:
        """The host instant, by the clocks as observed last; ACROSS_CLOCK_STEP where it may precede a step."""
        unix_ns = host_from_seconds(unix_s)
        host_ns = whole_microseconds(unix_ns - self.unix_minus_host_ns)
        for step in self._steps:
            if _may_precede(step, unix_ns, host_ns, arrival_ns):
                return NoFrame(Reason.ACROSS_CLOCK_STEP, f"the wall clock was set by {step.size_s:+.3f} s")
        return host_ns

    def host_from_monotonic(self, monotonic_s: float) -> HostNs | NoFrame:
        """The same clock as the host's."""
        return host_from_seconds(monotonic_s)


def _may_precede(step: ClockStep, unix_ns: int, host_ns: int, arrival_ns: HostNs | None) -> bool:
    """Whether a stamp that reads ``host_ns`` by the clock of now may have been made before the step."""
    if host_ns < step.seen_ns:
        return True
    if arrival_ns is None or arrival_ns - step.seen_ns > LONGEST_WAY_NS:
        return False
    by_old_clock_ns = unix_ns - step.before_ns
    return step.seen_ns - LONGEST_WAY_NS <= by_old_clock_ns <= step.seen_ns


class RecordingClock:
    """A recording: ``time_unix`` lies a fixed offset from its host clock, and nothing places the board's monotonic."""

    def __init__(self, unix_minus_host_ns: int = 0) -> None:
        self._unix_minus_host_ns = unix_minus_host_ns

    def host_from_unix(self, unix_s: float, arrival_ns: HostNs | None) -> HostNs | NoFrame:  # noqa: ARG002
        """The stamp on the recording's own host clock."""
        return HostNs(host_from_seconds(unix_s) - self._unix_minus_host_ns)

    def host_from_monotonic(self, monotonic_s: float) -> HostNs | NoFrame:  # noqa: ARG002
        """NO_MONOTONIC_MAP."""
        return NoFrame(Reason.NO_MONOTONIC_MAP)
