"""What arrivals show of the clock: a message never arrives before its stamp, and some arrive hardly later.

Between exchanges they watch the line: a pause, a step or a new rate shows within messages. A message that waited in a
queue looks like one of a clock that paused, so that the least delay of a few messages is compared with the delays that
the link had before, and exchanges decide. Without exchanges they are the estimate: the least delay of the last seconds
is the offset, the convex hull of a minute the skew (Zhang, Liu & Xia 2002). A hull of ten seconds means nothing within
100 ppm, a minimum of a minute contains the skew.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import sqrt

from fwav_companion.geometry.hull import Point, lower_hull
from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.telemetry.clock.clock_line import MOST_SKEW, ClockLine

ARRIVALS = 5
"""Number of arrivals whose least delay is compared: four of them may be late by chance."""
LATE_NS, EARLY_NS = 12_000_000, 2_000_000
"""Least departure of the least delay that counts: later, and earlier than the stamp, which no delay explains."""
SPREADS = 4
"""Departure in mean absolute deviations of the least delay that counts too: a radio's delays vary by themselves."""
MEMORY = 16
"""Number of windows over which the usual least delay and its deviation are averaged."""
FIRST_SPREAD_NS = 3_000_000
QUIET_GAPS, GAP_MEMORY = 2, 64
"""Silence, in largest gaps, that a pause may explain, and number of arrivals over which the largest gap fades."""

BUCKET_NS = NS_PER_S
BUCKETS, SIMULATED_BUCKETS, LEVEL_BUCKETS = 60, 6, 10
"""Number of buckets of one second whose least delay is stored, for a crystal's clock and for a simulator, and of those
that show the offset. A simulator's rate varies with its load. In a recorded flight of PX4's simulator at 0.987 of real
time these least delays lie within 3 ms of a line over 6 s (median), within 14 ms over 30 s; over 2 s a single late one
bends the line."""
RATE_VARIES = 0.02
"""One sigma of a simulator's rate within those buckets, in units of its departure from real time. At the recorded 0.987
the term is 0.8 ms, and the total sigma there is 2.5 times the error; pauses are covered by LATE_ARRIVALS."""
ARRIVALS_TO_BEGIN = 3
"""Number of arrivals from which there is an estimate."""
LEAST_SPAN_S = 10.0
"""Least time between first and last bucket for a skew, s."""
ARRIVALS_FOR_LEVEL = 100
"""Number of arrivals that should show the offset: at 1 Hz the least delay of ten seconds is a tenth of its scatter."""
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
ASSUMED_SCATTER_S = 3.3e-3
"""That mean before the first window, which counts as one more: a radio's, because three arrivals agree by chance."""
SCATTER_SIGMAS = 2.0
"""Standard errors by which the scatter of n windows may be larger than it looks: each one's is as large as it."""
TRUNCATION_NS = 500_000
"""Mean truncation of a stamp to whole milliseconds."""
LEAST_DELAY_BOUND_S = 0.1
"""Bound of the least transport delay, s. It is an assumption, not a measurement: images cannot be paired over a link
whose fastest message takes longer."""


class ArrivalWatch:
    """Departure of the newest arrivals from the line of exchanges."""

    __slots__ = ("_gap_ns", "_spread_ns", "_usual_ns", "_window", "agreed_ns", "departure_s", "heard_ns", "least_ns")

    def __init__(self) -> None:
        self._gap_ns = 0
        self._spread_ns = FIRST_SPREAD_NS
        self.heard_ns: HostNs | None = None
        """Newest arrival."""
        self.agreed_ns: HostNs | None = None
        """Last window of arrivals that agreed with the line."""
        self.restart()

    def restart(self) -> None:
        """Take the next delays as usual: the line is another, or an exchange showed that a queue has grown."""
        self._window: list[int] = []
        self._usual_ns: int | None = None
        self._spread_ns = max(self._spread_ns, FIRST_SPREAD_NS)
        self.least_ns = 0
        """Least delay since then, nanoseconds; 0 before the first window."""
        self.departure_s = 0.0
        """By how much the newest arrivals contradict the line, seconds; 0 where they agree."""

    def insert(self, stamp_ns: BootNs, arrival_ns: HostNs, line: ClockLine | None) -> bool:
        """Take an arrival. Returns whether a contradiction has just begun."""
        heard_ns = self.heard_ns
        if heard_ns is not None:
            self._gap_ns = max(self._gap_ns - self._gap_ns // GAP_MEMORY, arrival_ns - heard_ns)
        self.heard_ns = arrival_ns
        if line is None:
            return False
        window = self._window
        window.append(arrival_ns - stamp_ns - line.offset_ns - round(line.skew * (arrival_ns - line.ref_host_ns)))
        return len(window) == ARRIVALS and self._departs(line, arrival_ns)

    def quiet_s(self, host_ns: HostNs, exchanged_ns: HostNs | None) -> float:
        """Time for which a paused clock would explain the silence before ``host_ns``, seconds."""
        if self.heard_ns is None or self._gap_ns == 0:
            return 0.0
        last_ns = self.heard_ns if exchanged_ns is None else max(self.heard_ns, exchanged_ns)
        return max(0, host_ns - last_ns - QUIET_GAPS * self._gap_ns) * 1e-9

    def _departs(self, line: ClockLine, arrival_ns: HostNs) -> bool:
        """Compare a window with the line and the usual delay. Returns whether a contradiction has just begun."""
        least_ns, most_ns = min(self._window), max(self._window)
        self._window.clear()
        usual_ns = least_ns if self._usual_ns is None else self._usual_ns
        room_ns = round(4e9 * line.scatter(arrival_ns) ** 0.5) + SPREADS * self._spread_ns
        agreed = self.departure_s == 0.0
        if least_ns > usual_ns + room_ns + LATE_NS:
            self.departure_s = (least_ns - usual_ns) * 1e-9
        elif most_ns < -room_ns - EARLY_NS:
            self.departure_s = -most_ns * 1e-9
        else:
            self.departure_s, self.agreed_ns = 0.0, arrival_ns
            self.least_ns = least_ns if self._usual_ns is None else min(self.least_ns, least_ns)
            self._usual_ns = usual_ns + (least_ns - usual_ns) // MEMORY
            self._spread_ns += (abs(least_ns - usual_ns) - self._spread_ns) // MEMORY
        return agreed and self.departure_s > 0.0


class ArrivalEnvelope:
    """Line through the lower envelope of arrival minus stamp, biased late by the least transport delay.

    Stamps are truncated to whole milliseconds, which only makes a message look later: the envelope needs no correction.
    """

    __slots__ = (
        "_begun_ns",
        "_buckets",
        "_count",
        "_delay_s",
        "_delay_sigma_s",
        "_fitted",
        "_least_skew",
        "_line",
        "_most_skew",
        "_scatter_s",
        "_stored",
        "_unsteady",
        "_window",
        "_windows",
        "late_s",
    )

    def __init__(self, rate: float = 1.0) -> None:
        """``rate``: rate of the autopilot's clock, if not a crystal's; it varies by as much as it differs from 1."""
        room = max(MOST_SKEW, abs(1.0 - rate))
        # At least half the rate: a simulator that pauses repeats its stamp, and a skew of 1 would be a clock at rest.
        self._least_skew, self._most_skew = 1.0 - rate - room, min(1.0 - rate + room, 1.0 - 0.5 * rate)
        self._stored = BUCKETS if room == MOST_SKEW else SIMULATED_BUCKETS
        self._unsteady = RATE_VARIES * abs(1.0 - rate)
        self._line: ClockLine | None = None
        self._fitted = True
        self._buckets: list[tuple[int, HostNs, int]] = []  # (second, arrival, least offset), oldest first
        self._count, self._begun_ns = 0, HostNs(0)
        self._delay_s, self._delay_sigma_s = 0.0, 0.0
        """Least delay that is subtracted, and its one sigma, seconds; 0 where it is not known."""
        self._window: list[int] = []
        self._windows, self._scatter_s = 1, ASSUMED_SCATTER_S
        """Number of windows, and mean of the least delays of LATE_ARRIVALS, seconds."""
        self.late_s = 0.0
        """Lateness of the newest arrivals against the line, seconds; it adds to the line's own sigma. Either the clock
        paused for a while, as a simulator's does, or a queue has grown. The line follows a clock that paused only when
        the buckets from before the pause are gone."""

    def expect_delay(self, least_s: float, sigma_s: float) -> None:
        """Subtract this least delay, which exchanges showed before, with one sigma in seconds."""
        self._delay_s, self._delay_sigma_s = least_s, min(LEAST_DELAY_SIGMA_S, 1e-3 + sigma_s)

    def insert(self, stamp_ns: BootNs, arrival_ns: HostNs) -> None:
        """Take the stamp and the arrival of a message."""
        offset_ns, line = arrival_ns - stamp_ns - TRUNCATION_NS, self.line
        if line is not None:
            self._compare(offset_ns - line.offset_ns - round(line.skew * (arrival_ns - line.ref_host_ns)))
        self._count += 1
        if self._count == 1:
            self._begun_ns = arrival_ns
        buckets = self._buckets
        bucket = (stamp_ns if self._stored == BUCKETS else arrival_ns) // BUCKET_NS
        if not buckets or buckets[-1][0] < bucket:
            buckets.append((bucket, arrival_ns, offset_ns))
            del buckets[: -self._stored]
        elif offset_ns < buckets[-1][2]:
            buckets[-1] = (buckets[-1][0], arrival_ns, offset_ns)
        elif self._count > ARRIVALS_TO_BEGIN:
            return
        self._fitted = False

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
        return abs(least_ns - offset_ns) * 1e-9 + LEAST_DELAY_BOUND_S

    def _compare(self, late_ns: int) -> None:
        """Compare an arrival with the line before it."""
        self._window.append(late_ns)
        if len(self._window) == LATE_ARRIVALS:
            self.late_s = max(0.0, min(self._window) * 1e-9 - self._delay_s)
            self._window.clear()
            self._windows += 1
            usual_s = min(self.late_s, 2.0 * self._scatter_s + LEAST_DELAY_SIGMA_S)  # a pause is no scatter
            self._scatter_s += (usual_s - self._scatter_s) / min(self._windows, SCATTER_MEMORY)

    def _fit(self) -> ClockLine:
        """Line along the lower convex hull's edge at the mean instant, lowered to the last seconds' least delay."""
        _, ref_ns, ref_offset_ns = self._buckets[-1]
        points = [((at - ref_ns) * 1e-9, (offset - ref_offset_ns) * 1e-9) for _, at, offset in self._buckets]
        slope = self._slope(points)
        span = max(1.0, -points[0][0])
        rate_hz = self._count / max(1.0, (ref_ns - self._begun_ns) * 1e-9)
        used = max(LEVEL_BUCKETS, round(ARRIVALS_FOR_LEVEL / rate_hz))
        heights = [y - slope * t for t, y in points[-used:]]
        level = min(heights)
        above = sum([(height - level) ** 2 for height in heights[-LEVEL_BUCKETS:]]) / min(len(heights), LEVEL_BUCKETS)
        # A link whose delays scatter has a long least one, above which the least of n exponential ones lies a mean / n.
        scatter_s = SLOW_LINK * self._scatter_s
        delay_s = max(LEAST_DELAY_SIGMA_S, scatter_s * (1.0 + SCATTER_SIGMAS / sqrt(self._windows)))
        return ClockLine(
            ref_host_ns=ref_ns,
            offset_ns=ref_offset_ns + round((level - self._delay_s) * NS_PER_S),
            skew=slope,
            var_offset=above + (scatter_s / self._count) ** 2 + (0.5 * span * self._unsteady) ** 2,
            var_skew=above / span**2 + 1e-12,
            var_bias=(self._delay_sigma_s or delay_s) ** 2,
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
