"""Clock estimate without TIMESYNC: a message never arrives before its stamp, and some arrive hardly later."""

from __future__ import annotations

from itertools import pairwise

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.telemetry.clock.clock_line import MOST_SKEW, ClockLine
from fwav_companion.telemetry.clock.envelopes import lower_hull

BUCKET_NS = NS_PER_S
BUCKETS, SIMULATED_BUCKETS = 30, 6
"""Number of buckets of one second whose least delay is stored, for a crystal's clock and for a simulator, whose rate
varies with its load. In a recorded flight of PX4's simulator at 0.987 of real time these least delays lie within 3 ms
of a line over 6 s (median), within 14 ms over 30 s; over 2 s a single late one bends the line."""
RATE_VARIES = 0.02
"""One sigma of a simulator's rate within those buckets, in units of its departure from real time: the follower's
RATE_WANDER at a departure of a tenth. At the recorded 0.987 the term is 0.8 ms, and the total sigma there is 2.5 times
the error; pauses are covered by LATE_ARRIVALS."""
ARRIVALS_TO_BEGIN = 10
LATE_ARRIVALS = 3
"""Number of arrivals in one window. The least late of them is used, because one or two may be late by chance. The least
of three exponential delays is a third of their mean. Windows do not overlap, so a pause is seen within five
arrivals."""

LEAST_DELAY_SIGMA_S = 5e-3
"""One sigma of the least transport delay, which arrivals cannot show, s: 0.4 ms on a 921600 serial line, 7 ms at 57600,
a few over Wi-Fi; a telemetry radio's tens of milliseconds are three of these sigmas."""
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
        "_late",
        "_least_late_ns",
        "_least_skew",
        "_most_skew",
        "_stored",
        "_unsteady",
        "late_s",
        "line",
    )

    def __init__(self, rate: float = 1.0) -> None:
        """``rate``: rate of the autopilot's clock, if not a crystal's; it varies by as much as it differs from 1."""
        self.line: ClockLine | None = None
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

    def insert(self, stamp_ns: BootNs, arrival_ns: HostNs) -> None:
        """Take the stamp and the arrival of a message."""
        self._count += 1
        offset_ns = arrival_ns - stamp_ns
        line = self.line
        if line is not None:
            late_ns = offset_ns - line.offset_ns - round(line.skew * (arrival_ns - line.ref_host_ns))
            self._least_late_ns = late_ns if self._late == 0 else min(self._least_late_ns, late_ns)
            self._late = (self._late + 1) % LATE_ARRIVALS
            if self._late == 0:
                self.late_s = max(0, self._least_late_ns) * 1e-9
        bucket = (stamp_ns if self._stored == BUCKETS else arrival_ns) // BUCKET_NS
        if self._buckets and self._buckets[-1][0] >= bucket:
            if offset_ns >= self._buckets[-1][2] and (self.line is not None or self._count != ARRIVALS_TO_BEGIN):
                return
            if offset_ns < self._buckets[-1][2]:
                self._buckets[-1] = (self._buckets[-1][0], arrival_ns, offset_ns)
        else:
            self._buckets.append((bucket, arrival_ns, offset_ns))
            if len(self._buckets) > self._stored:
                del self._buckets[0]
        if self._count >= ARRIVALS_TO_BEGIN:
            self.line = self._fit()

    def bound_s(self, now: HostNs, offset_ns: int) -> float:
        """Bound of the offset's error, seconds: the assumed bound of the least delay below, drift alone above."""
        least_ns = min(
            [o + (self._most_skew if now > at else self._least_skew) * (now - at) for _, at, o in self._buckets]
        )
        return max(abs(least_ns - offset_ns) * 1e-9, 0.0) + LEAST_DELAY_BOUND_S

    def _fit(self) -> ClockLine:
        """Line along the lower convex hull's edge at the mean instant: the highest line below all points there."""
        _, ref_ns, ref_offset_ns = self._buckets[-1]
        points = [((at - ref_ns) * 1e-9, (offset - ref_offset_ns) * 1e-9) for _, at, offset in self._buckets]
        hull = lower_hull(points)
        mean_t = sum([t for t, _ in points]) / len(points)
        (t0, y0), slope = hull[-1], 0.0
        for (ta, ya), (tb, yb) in pairwise(hull):
            if tb >= mean_t and tb > ta:  # messages of one datagram arrived at one instant, whatever their stamps
                t0, y0, slope = ta, ya, (yb - ya) / (tb - ta)
                break
        slope = max(self._least_skew, min(self._most_skew, slope))
        level = min([y - slope * t for t, y in points]) if points else y0 - slope * t0
        above = sum([(y - slope * t - level) ** 2 for t, y in points]) / len(points)
        span = max(1.0, -points[0][0])
        return ClockLine(
            ref_host_ns=ref_ns,
            offset_ns=ref_offset_ns + round(level * 1e9),
            skew=slope,
            var_offset=LEAST_DELAY_SIGMA_S**2 + above + (0.5 * span * self._unsteady) ** 2,
            cov_offset_skew=0.0,
            var_skew=above / span**2 + 1e-12,
        )
