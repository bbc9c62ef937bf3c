"""Clock estimate without TIMESYNC: a message never arrives before its stamp, and some arrive hardly later.

The least delay of the last seconds is the offset, the convex hull of a minute the skew (Zhang, Liu & Xia 2002): a hull
of ten seconds means nothing within 100 ppm, a minimum of a minute contains the skew.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import sqrt

from fwav_companion.geometry.hull import Point, lower_hull
from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.telemetry.clock.clock_line import MOST_SKEW, ClockLine

BUCKET_NS = NS_PER_S
BUCKETS, SIMULATED_BUCKETS, LEVEL_BUCKETS = 60, 6, 10
"""Number of buckets of one second whose least delay is stored, for a crystal's clock and for a simulator, and of those
that show the offset. A simulator's rate varies with its load. In a recorded flight of PX4's simulator at 0.987 of real
time these least delays lie within 3 ms of a line over 6 s (median), within 14 ms over 30 s; over 2 s a single late one
bends the line."""
RATE_VARIES = 0.02
"""One sigma of a simulator's rate within those buckets, in units of its departure from real time. At the recorded 0.987
the term is 0.8 ms, and the total sigma there is 2.5 times the error; pauses are covered by LATE_ARRIVALS."""
ARRIVALS_TO_BEGIN, FIRST_ARRIVALS = 3, 10
"""Number of arrivals from which there is an estimate, and of those whose scatter is known at the beginning."""
LEAST_SPAN_S = 10.0
"""Least time between first and last bucket for a skew, s."""
LATE_ARRIVALS = 3
"""Number of arrivals in one window. The least late of them is used, because one or two may be late by chance. The least
of three exponential delays is a third of their mean. Windows do not overlap, so a pause is seen within five
arrivals."""

LEAST_DELAY_SIGMA_S = 5e-3
"""One sigma of the least transport delay, which arrivals cannot show, s: 0.4 ms on a 921600 serial line, 7 ms at 57600,
a few over Wi-Fi; a telemetry radio's tens of milliseconds are three of these sigmas."""
SLOW_LINK, SCATTER_MEMORY = 6.0, 32
"""One sigma of the least delay in mean least delays of LATE_ARRIVALS, and the number of these in the mean: a link
whose delays scatter by 10 ms (least of three: 3.3) is a radio, with a least delay of tens of milliseconds."""
EARLY_ARRIVALS = 30
"""Number of arrivals until which the scatter of the first ones counts."""
ASSUMED_ARRIVALS, ASSUMED_SCATTER_S = 2, 10e-3
"""Number and scatter of the arrivals that are assumed before the first one, as of a radio: three agree by chance."""
SCATTER_SIGMAS = 2.0
"""Standard errors by which the scatter of n windows may be larger than it looks: each one's is as large as it."""
ARRIVALS_FOR_LEVEL = 100
"""Number of arrivals that should show the offset: at 1 Hz the least delay of ten seconds is a tenth of its scatter."""
TRUNCATION_NS = 500_000
"""Mean truncation of a stamp to whole milliseconds."""
LEAST_DELAY_BOUND_S = 0.1
"""Bound of the least transport delay, s. It is an assumption, not a measurement: images cannot be paired over a link
whose fastest message takes longer."""


class ArrivalEnvelope:
    """Line through the lower envelope of arrival minus stamp, biased late by the least transport delay.

    Stamps are truncated to whole milliseconds, which only makes a message look later: the envelope needs no correction.
    """

    __slots__ = (
        "_buckets",
        "_count",
        "_first",
        "_fitted",
        "_late",
        "_least_late_ns",
        "_least_skew",
        "_line",
        "_most_skew",
        "_scatter_s",
        "_spread_ns",
        "_stored",
        "_unsteady",
        "_windows",
        "late_s",
        "least_delay_s",
        "least_delay_sigma_s",
    )

    def __init__(self, rate: float = 1.0) -> None:
        """``rate``: rate of the autopilot's clock, if not a crystal's; it varies by as much as it differs from 1."""
        self._line: ClockLine | None = None
        self._fitted = True
        self.late_s = 0.0
        """Lateness of the newest arrivals against the line, seconds; it adds to the line's own sigma. Either the clock
        paused for a while, as a simulator's does, or a queue has grown. The line follows a clock that paused only when
        the buckets from before the pause are gone."""
        self._late, self._least_late_ns = 0, 0
        room = max(MOST_SKEW, abs(1.0 - rate))
        self._stored = BUCKETS if room == MOST_SKEW else SIMULATED_BUCKETS
        self._unsteady = RATE_VARIES * abs(1.0 - rate)
        # At least half the rate: a simulator that pauses repeats its stamp, and a skew of 1 would be a clock at rest.
        self._least_skew, self._most_skew = 1.0 - rate - room, min(1.0 - rate + room, 1.0 - 0.5 * rate)
        self._buckets: list[tuple[int, HostNs, int]] = []  # (second, arrival, least offset), oldest first
        self._count = 0
        self._first = (HostNs(0), 0)
        self._windows, self._scatter_s = 0, 0.0
        """Mean of the least delays of LATE_ARRIVALS, seconds."""
        self._spread_ns = 0
        """Sum of the first arrivals' offsets beyond the first one."""
        self.least_delay_s, self.least_delay_sigma_s = 0.0, LEAST_DELAY_SIGMA_S
        """Least delay that is subtracted, and its one sigma, seconds: known where exchanges were answered before."""

    def insert(self, stamp_ns: BootNs, arrival_ns: HostNs) -> None:
        """Take the stamp and the arrival of a message."""
        offset_ns = arrival_ns - stamp_ns - TRUNCATION_NS
        count = self._count = self._count + 1
        if count <= FIRST_ARRIVALS:
            if count == 1:
                self._first = (arrival_ns, offset_ns)
            self._spread_ns += offset_ns - self._first[1]
            self._fitted = False
        buckets = self._buckets
        bucket = (stamp_ns if self._stored == BUCKETS else arrival_ns) // BUCKET_NS
        if not buckets or buckets[-1][0] < bucket:
            buckets.append((bucket, arrival_ns, offset_ns))
            if len(buckets) > self._stored:
                del buckets[0]
            self._fitted = False
        elif offset_ns < buckets[-1][2]:
            buckets[-1] = (buckets[-1][0], arrival_ns, offset_ns)
            self._fitted = False

    def watch(self, stamp_ns: BootNs, arrival_ns: HostNs) -> None:
        """Compare an arrival with the line before it: needed where the line is the estimate in use."""
        line = self.line
        if line is None:
            return
        late_ns = (
            arrival_ns - stamp_ns - TRUNCATION_NS - line.offset_ns - round(line.skew * (arrival_ns - line.ref_host_ns))
        )
        self._least_late_ns = late_ns if self._late == 0 else min(self._least_late_ns, late_ns)
        self._late = (self._late + 1) % LATE_ARRIVALS
        if self._late == 0:
            self.late_s = max(0.0, self._least_late_ns * 1e-9 - self.least_delay_s)
            self._windows += 1
            usual_s = min(self.late_s, 2.0 * self._scatter_s + LEAST_DELAY_SIGMA_S)  # a pause is no scatter
            self._scatter_s += (usual_s - self._scatter_s) / min(self._windows, SCATTER_MEMORY)

    @property
    def line(self) -> ClockLine | None:
        """The line; None before there are enough arrivals."""
        if not self._fitted:
            self._fitted = True
            if self._count >= ARRIVALS_TO_BEGIN:
                self._line = self._fit()
        return self._line

    def bound_s(self, now: HostNs, offset_ns: int) -> float:
        """Bound of the offset's error, seconds: the assumed bound of the least delay below, drift alone above."""
        least_ns = min(
            [o + (self._most_skew if now > at else self._least_skew) * (now - at) for _, at, o in self._buckets]
        )
        return max(abs(least_ns - offset_ns) * 1e-9, 0.0) + LEAST_DELAY_BOUND_S

    def _fit(self) -> ClockLine:
        """Line along the lower convex hull's edge at the mean instant, lowered to the last seconds' least delay."""
        _, ref_ns, ref_offset_ns = self._buckets[-1]
        points = [((at - ref_ns) * 1e-9, (offset - ref_offset_ns) * 1e-9) for _, at, offset in self._buckets]
        slope = self._slope(points)
        span = max(1.0, -points[0][0])
        rate_hz = self._count / max(1.0, (ref_ns - self._first[0]) * 1e-9)
        used = max(LEVEL_BUCKETS, round(ARRIVALS_FOR_LEVEL / rate_hz))
        heights = [y - slope * t for t, y in points[-used:]]
        level = min(heights)
        above = sum([(height - level) ** 2 for height in heights[-LEVEL_BUCKETS:]]) / min(len(heights), LEVEL_BUCKETS)
        early = self._early_scatter(level, ref_offset_ns) if self._count <= EARLY_ARRIVALS else 0.0
        return ClockLine(
            ref_host_ns=ref_ns,
            offset_ns=ref_offset_ns + round((level - self.least_delay_s) * NS_PER_S),
            skew=slope,
            var_offset=above + (2.0 * early / self._count) ** 2 + (0.5 * span * self._unsteady) ** 2,
            var_skew=above / span**2 + 1e-12,
            var_bias=self._delay_sigma_s(early) ** 2,
        )

    def _slope(self, points: Sequence[Point]) -> float:
        nominal = 0.5 * (self._least_skew + self._most_skew)
        if self._stored == BUCKETS and points[-1][0] - points[0][0] < LEAST_SPAN_S:
            return nominal
        mean_t = sum([t for t, _ in points]) / len(points)
        slope = nominal if self._stored == BUCKETS else 0.0
        for (ta, ya), (tb, yb) in pairwise(lower_hull(points)):
            if tb >= mean_t and tb > ta:  # messages of one datagram arrived at one instant, whatever their stamps
                slope = (yb - ya) / (tb - ta)
                break
        return max(self._least_skew, min(self._most_skew, slope))

    def _early_scatter(self, level: float, ref_offset_ns: int) -> float:
        """Mean of the first delays beyond the least one, seconds: the least of n exponential ones lies a mean / n above
        zero.
        """
        count = min(self._count, FIRST_ARRIVALS)
        mean_s = max(0.0, (self._first[1] - ref_offset_ns + self._spread_ns / count) * 1e-9 - level)
        return mean_s + (ASSUMED_SCATTER_S * ASSUMED_ARRIVALS) / count

    def _delay_sigma_s(self, early_scatter: float) -> float:
        """One sigma of the least delay, seconds: a link whose delays scatter has a long least one, too."""
        if self.least_delay_s != 0.0:
            return self.least_delay_sigma_s
        scatter = SLOW_LINK * self._scatter_s * (1.0 + SCATTER_SIGMAS / sqrt(max(1, self._windows)))
        return max(self.least_delay_sigma_s, scatter, SLOW_LINK / LATE_ARRIVALS * early_scatter)
