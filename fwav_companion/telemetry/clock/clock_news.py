"""Reports about the autopilot's clock, a slip or its rate, each once."""

from __future__ import annotations

from math import sqrt
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.telemetry.clock.clock_line import MOST_SKEW, ClockLine
from fwav_companion.telemetry.clock.exchange_clock import ExchangeClock

DECIDED_AFTER_NS = 5 * NS_PER_S
"""Time after a change before a report: a slip and a new rate look alike until the rate has been measured."""
CRYSTAL_DECIDED_AFTER_NS = 20 * NS_PER_S
"""The same for a rate that a crystal may have: in a recorded flight of a simulator 200 ppm came and went in 10 s."""
QUIET_NS = 2 * NS_PER_S
"""Time since the last change before a report: slips in a row are reported as one."""
LEAST_REPORTED_SLIP_S, SLIP_SIGMAS = 5e-3, 3.0
LEAST_BEFORE = 10
"""Number of exchanges before a change without which it is not a slip: the lock itself was wrong."""
NORMAL_RATE = 100e-6
"""Difference of the rate from 1 below which a reported rate is over."""
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
    """Decides which changes of the clock are reported, and when."""

    __slots__ = ("_before", "_changed_ns", "_moved_ns", "_rate", "_seen", "_spread_s")

    def __init__(self) -> None:
        self._changed_ns: HostNs | None = None
        self._moved_ns = HostNs(-QUIET_NS)
        self._before: ClockLine | None = None
        """The line before the first change that is not reported yet."""
        self._spread_s = 0.0
        self._rate: float | None = None
        self._seen = 0

    def on_exchange(self, exchanges: ExchangeClock, ended: ClockLine | None, now: HostNs) -> ClockNews | None:
        """Report after an exchange; ``ended``: the line that it ended. None without news."""
        line = exchanges.line
        if line is None:
            return None
        if ended is not None and self._seen >= LEAST_BEFORE:
            self._before = self._before or ended
            self._spread_s = sqrt(self._spread_s**2 + ended.scatter(now) + line.scatter(now))
            self._moved_ns = now
            if self._changed_ns is None:
                self._changed_ns = now
        self._seen = exchanges.accepted if ended is None else 0
        if self._changed_ns is None and not exchanges.changed and exchanges.in_doubt:
            return None
        undecided = self._changed_ns is not None and now - self._changed_ns < DECIDED_AFTER_NS
        if undecided or now - self._moved_ns < QUIET_NS:
            return None
        crystal = abs(line.skew) < MOST_SKEW
        is_measured = now - exchanges.segment_ns >= (CRYSTAL_DECIDED_AFTER_NS if crystal else DECIDED_AFTER_NS)
        return (self._rate_news(line) if is_measured else None) or self._slip_news(line, exchanges.segment_ns)

    def _rate_news(self, line: ClockLine) -> ClockRate | None:
        if line.differs:
            rate = 1.0 - line.skew
            if self._rate is not None and abs(rate - self._rate) < RATE_CHANGED:
                return None
            self._rate = rate
            return ClockRate(rate)
        if self._rate is not None and abs(line.skew) < NORMAL_RATE:
            self._rate = None
            return ClockRate(1.0)
        return None

    def _slip_news(self, line: ClockLine, segment_ns: HostNs) -> ClockSlipped | None:
        before, spread_s = self._before, self._spread_s
        self._before = self._changed_ns = None
        self._spread_s = 0.0
        if before is None:
            return None
        # By the line that all exchanges since define: that of the first three knows the step less well.
        by_s = (line.offset_ns_at(segment_ns) - before.offset_ns_at(segment_ns)) * 1e-9
        reported = self._rate is None and abs(by_s) > max(LEAST_REPORTED_SLIP_S, SLIP_SIGMAS * spread_s)
        return ClockSlipped(by_s) if reported else None
