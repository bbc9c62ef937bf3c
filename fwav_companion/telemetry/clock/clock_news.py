"""Reports about a followed clock, a slip or its rate, each once."""

from __future__ import annotations

from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S
from fwav_companion.telemetry.clock.followed import FollowedClock

DECIDED_AFTER_NS = 5 * NS_PER_S
"""Time after a first contradiction before a report: a slip and a new rate look alike until the rate has been measured
for this time."""
LEAST_REPORTED_SLIP_S = 5e-3
QUIET_NS = 2 * NS_PER_S
"""Time between slips below which they are reported as one: an exchange may fall into the middle of a pause."""
LEAST_REPORTED_RATE, RATE_SIGMAS = 2e-3, 4.0
"""Differences of a rate from 1, absolute and in sigmas, that it must both exceed to be reported: three times the range
of crystals, and chance."""
RATE_CHANGED = 0.02
"""Change of a reported rate after which it is reported again."""


class ClockSlipped(msgspec.Struct, frozen=True):
    """The autopilot's clock slipped once against the host's and runs on at its rate."""

    by_s: float
    """Time by which the clock fell behind, seconds; negative: it went ahead."""


class ClockRate(msgspec.Struct, frozen=True):
    """The autopilot's clock runs at another rate than a crystal's."""

    rate: float
    """Autopilot seconds per host second."""


ClockNews: TypeAlias = ClockSlipped | ClockRate


class ClockReports:
    """Decides which events of a followed clock are reported, and when."""

    __slots__ = ("_left_ns", "_moved_ns", "_rate", "_reported_s", "_slips_s")

    def __init__(self) -> None:
        self._slips_s, self._moved_ns = 0.0, 0
        self._left_ns: int | None = None
        self._rate: float | None = None
        self._reported_s = 0.0

    def on_left(self, followed: FollowedClock) -> None:
        """Note that the clock left a crystal's range."""
        self._left_ns, self._reported_s = followed.newest.host_ns, 0.0
        self._slips_s, self._moved_ns = 0.0, followed.newest.host_ns

    def on_followed(self, followed: FollowedClock) -> ClockNews | None:
        """Report after an exchange of a followed clock; None without news."""
        now_ns = followed.newest.host_ns
        if followed.slips_s != self._slips_s:
            self._slips_s, self._moved_ns = followed.slips_s, now_ns
        if self._left_ns is None or now_ns - self._left_ns < DECIDED_AFTER_NS or now_ns - self._moved_ns < QUIET_NS:
            return None
        rate, sigma, _ = followed.rate
        if abs(rate - 1.0) > max(LEAST_REPORTED_RATE, RATE_SIGMAS * sigma):
            if self._rate is not None and abs(rate - self._rate) < RATE_CHANGED:
                return None
            self._rate, self._reported_s = rate, followed.slips_s
            return ClockRate(rate)
        by_s, self._reported_s = followed.slips_s - self._reported_s, followed.slips_s
        return ClockSlipped(by_s) if self._rate is None and abs(by_s) > LEAST_REPORTED_SLIP_S else None

    def on_calm(self) -> ClockNews | None:
        """Note that the clock is a crystal's again; returns that rate where another one was reported."""
        self._left_ns = None
        if self._rate is None:
            return None
        self._rate = None
        return ClockRate(1.0)
