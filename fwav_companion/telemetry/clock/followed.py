"""Follows a clock that slips, or runs at another rate than a crystal can: a Kalman filter of offset and rate.

The offset is a random walk whose intensity is estimated from the innovations (innovation-based adaptive estimation,
Mehra 1970). The rate is a random walk of fixed intensity. An innovation that the walk does not explain is a slip: the
offset then starts again at the exchange, and the rate is kept. Past instants are smoothed (Rauch, Tung & Striebel
1965), so that a picture from before a slip keeps the offset from before the slip.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from math import sqrt

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.telemetry.clock.clock_line import MOST_SKEW
from fwav_companion.telemetry.clock.hard_bound import ROUNDING_NS, Exchange, HardBound
from fwav_companion.telemetry.clock.offset_smoother import Knot, predicted, smoothed
from fwav_companion.telemetry.clock.round_trip_weights import RESOLUTION_S

MOST_KNOTS = 300
"""Most stored knots: half a minute at ten exchanges a second."""
SLOWEST, FASTEST = 0.1, 10.0
"""Range of the rates that are followed, autopilot seconds per host second: a simulator runs at a tenth of real time on
a slow computer, and at ten times real time where it is configured so."""
RATE_PRIOR = 3.0
"""One sigma of the rate before it was measured: a third of the widest range. With 0.3 the clock of a simulator at five
times real time is a second off for twenty seconds."""
UNKNOWN_RATE = 0.02
"""One sigma of a change of the rate when the clock is first seen to leave a crystal's range."""
WALK_MEMORY = 20
"""Number of exchanges over which the intensity of the walk is estimated: two seconds at ten a second."""
SLIP_SIGMAS, LEAST_SLIP_S = 5.0, 5e-3
"""Innovation, in sigmas and in seconds, that is a slip where it exceeds both."""
WILD_S, WILD_IN_AGREEMENT = 1.0, 3
"""Innovation beyond which this number of agreeing exchanges is required, s: it may be the answer of another clock."""
LEAST_APART_NS = 80_000_000
"""Least time between two exchanges that show the rate: for nearer ones, half a round trip over the time between is
large."""
CALM_NS, CALM_EXCHANGES = 20 * NS_PER_S, 20
"""Time and number of exchanges without a contradiction to 600 ppm after which the clock is a crystal's again."""
EXCHANGES_TO_WEIGH, LEAST_EXCESS = 12, 0.25
"""Number of exchanges that show the least round trip, and least excess that is used, in median excesses: delays that
scatter evenly err as much at the shortest round trip."""
HALF_US_NS, MOST_STEPS = 500, 12


class FollowedClock:
    """Offset of a clock that left the range of a crystal, at any instant of the last half minute and soon after."""

    __slots__ = (
        "_bound",
        "_calm_from_ns",
        "_from_ns",
        "_knots",
        "_pace",
        "_recent",
        "_ref_ns",
        "_ref_offset_ns",
        "_walk",
        "_wild",
    )

    def __init__(self, before: Iterable[Exchange], contradicting: Iterable[Exchange]) -> None:
        """``before``: exchanges within 600 ppm of one another; ``contradicting``: the later ones that are not."""
        self._knots: list[Knot] = []
        self._recent: list[Exchange] = []
        self._wild: list[Exchange] = []
        self._walk = 0.0
        self._pace: float | None = None
        for entry in before:
            self.insert(entry)
        self._walk = 0.0
        self._from_ns: HostNs | None = None
        for entry in contradicting:
            self.insert(entry)
            if self._from_ns is None:
                self._from_ns = entry.host_ns
                self._knots[-1].p11 += UNKNOWN_RATE**2
        self._bound, self._calm_from_ns = HardBound(), self._recent[-1].host_ns

    def insert(self, entry: Exchange) -> None:
        """Take one exchange, in order of time."""
        if not self._knots:
            return self._begin(entry)
        if entry.host_ns <= self._recent[-1].host_ns:  # it overtook another
            return None
        level_s = self._seconds(entry)
        t, last = self._t(entry.host_ns), self._knots[-1]
        dt = t - last.t
        expected_s, _, p00, p01, p11 = predicted(last, t, self._walk * dt)
        innovation = level_s - expected_s
        if abs(innovation) > WILD_S and not self._agree(entry):
            return None
        self._wild.clear()
        r = self._noise(entry)
        walk, slipped_s = self._walk * dt, 0.0
        if innovation**2 > SLIP_SIGMAS**2 * (p00 + r) and abs(innovation) > LEAST_SLIP_S:
            slipped_s, walk = innovation, walk + innovation**2
            p00 += innovation**2
        else:
            gain = 1.0 / WALK_MEMORY
            self._walk = max(0.0, self._walk + gain * (innovation**2 - p00 - r) / max(dt, LEAST_APART_NS * 1e-9))
        return self._update(entry, innovation, (p00, p01, p11, r), walk=walk, slipped_s=slipped_s)

    # Answers.

    @property
    def newest(self) -> Exchange:
        """The latest exchange."""
        return self._recent[-1]

    def calm(self) -> list[Exchange] | None:
        """Exchanges since the last contradiction to 600 ppm, once they show a crystal's clock again; else None."""
        if self.newest.host_ns - self._calm_from_ns < CALM_NS:
            return None
        calm = [entry for entry in self._recent if entry.host_ns > self._calm_from_ns]
        return calm if len(calm) >= CALM_EXCHANGES else None

    @property
    def best_round_trip_s(self) -> float:
        """Least round trip of the stored exchanges, seconds."""
        return min(knot.trip_s for knot in self._knots)

    @property
    def rate(self) -> tuple[float, float, float]:
        """Mean rate since the clock left a crystal's range, its one sigma, and the duration of its measurement, s.

        Autopilot seconds per host second, without slips.
        """
        start_t = self._knots[0].t if self._from_ns is None else max(self._knots[0].t, self._t(self._from_ns))
        first, last = next(knot for knot in self._knots if knot.t >= start_t), self._knots[-1]
        span_s = last.t - first.t
        if span_s <= 0.0:
            return 1.0 - last.slope, RATE_PRIOR, 0.0
        moved = last.level - first.level - (last.slipped_s - first.slipped_s)
        variance = self._walk / span_s + (first.p00 + last.p00) / span_s**2
        return 1.0 - moved / span_s, sqrt(variance), span_s

    @property
    def slips_s(self) -> float:
        """Sum of the slips within the stored knots, seconds; positive: the autopilot's clock fell behind."""
        return self._knots[-1].slipped_s - self._knots[0].slipped_s

    def offset_at(self, host_ns: HostNs) -> tuple[int, float, float]:
        """Offset in nanoseconds, d(offset)/d(host), and one sigma in seconds, at this host instant."""
        level, slope, variance = smoothed(self._knots, self._t(host_ns), self._walk)
        return self._ref_offset_ns + round(level * 1e9), slope, sqrt(max(variance, RESOLUTION_S**2))

    def host_from_boot(self, boot_ns: BootNs) -> HostNs:
        """Solution of ``host = boot + offset(host)``, by Newton's method kept inside an interval."""
        offset_ns, slope, _ = self.offset_at(HostNs(boot_ns + self.newest.offset_ns))
        host_ns = boot_ns + offset_ns
        for _ in range(MOST_STEPS):
            offset_ns, slope, _ = self.offset_at(HostNs(host_ns))
            missing_ns = boot_ns + offset_ns - host_ns
            if abs(missing_ns) <= HALF_US_NS:
                break
            host_ns += round(missing_ns / max(SLOWEST, min(FASTEST, 1.0 - slope)))
        return HostNs(host_ns)

    def bound_s(self, host_ns: HostNs, offset_ns: int) -> float:
        """Hard bound of the error of ``offset_ns``, seconds: the tighter one of the exchanges before and after.

        With the time from the exchange it widens by the largest rate error that the stored round trips allow.
        """
        pace, slope = self._largest_rate_error(), self._knots[-1].slope
        index = bisect_right(self._recent, host_ns, key=lambda entry: entry.host_ns)
        bounds = []
        for entry in self._recent[max(0, index - 1) : index + 1]:
            since_ns = host_ns - entry.host_ns
            reach_ns = entry.round_trip_ns / 2 + ROUNDING_NS + pace * abs(since_ns)
            bounds.append((abs(offset_ns - entry.offset_ns - slope * since_ns) + reach_ns) * 1e-9)
        return min(bounds)

    # Steps.

    def _begin(self, entry: Exchange) -> None:
        self._ref_ns, self._ref_offset_ns = entry.host_ns, entry.offset_ns
        trip_s = entry.round_trip_ns * 1e-9
        self._bound, self._calm_from_ns = HardBound(), entry.host_ns
        self._knots.append(
            Knot(
                t=0.0,
                trip_s=trip_s,
                level=0.0,
                slope=0.0,
                p00=self._noise(entry),
                p01=0.0,
                p11=RATE_PRIOR**2,
                walk=0.0,
                slipped_s=0.0,
            )
        )
        self._recent.append(entry)

    def _noise(self, entry: Exchange) -> float:
        """Variance of the offset of an exchange: its error is uniform in half the excess of its round trip either way.

        That is exact where each delay is a least delay plus an exponential tail. The least round trip is known after a
        few exchanges; before, the whole round trip is the excess.
        """
        excess_s = entry.round_trip_ns * 1e-9
        if len(self._knots) >= EXCHANGES_TO_WEIGH:
            trips = sorted(knot.trip_s for knot in self._knots)
            least_s = max(0.0, 2.0 * trips[0] - trips[3])
            excess_s = max(excess_s - least_s, LEAST_EXCESS * (trips[len(trips) // 2] - least_s))
        return excess_s**2 / 12.0 + RESOLUTION_S**2

    def _update(
        self,
        entry: Exchange,
        innovation: float,
        covariances: tuple[float, float, float, float],
        *,
        walk: float,
        slipped_s: float,
    ) -> None:
        p00, p01, p11, r = covariances
        last, t = self._knots[-1], self._t(entry.host_ns)
        k0, k1 = p00 / (p00 + r), p01 / (p00 + r)
        expected_s = last.level + last.slope * (t - last.t)
        self._knots.append(
            Knot(
                t=t,
                trip_s=entry.round_trip_ns * 1e-9,
                level=expected_s + k0 * innovation,
                slope=max(1.0 - FASTEST, min(1.0 - SLOWEST, last.slope + k1 * innovation)),
                p00=k0 * r,
                p01=(1.0 - k0) * p01,
                p11=p11 - k1 * p01,
                walk=walk,
                slipped_s=last.slipped_s + slipped_s,
            )
        )
        self._recent.append(entry)
        self._pace = None
        if self._bound.contradicts(entry):
            self._bound, self._calm_from_ns = HardBound(), entry.host_ns
        self._bound.take(entry)
        if len(self._knots) > MOST_KNOTS:
            del self._knots[0], self._recent[0]

    def _largest_rate_error(self) -> float:
        """Largest difference from the present slope that two consecutive exchanges allow, s/s."""
        if self._pace is not None:
            return self._pace
        slope, largest, earlier = self._knots[-1].slope, MOST_SKEW, self._recent[0]
        for entry in self._recent[1:]:
            between_ns = entry.host_ns - earlier.host_ns
            if between_ns < LEAST_APART_NS:
                continue
            slack_ns = (entry.round_trip_ns + earlier.round_trip_ns) / 2 + 2 * ROUNDING_NS
            moved_ns = entry.offset_ns - earlier.offset_ns - slope * between_ns
            largest = max(largest, (abs(moved_ns) + slack_ns) / between_ns)
            earlier = entry
        self._pace = largest
        return largest

    def _agree(self, entry: Exchange) -> bool:
        """Whether WILD_IN_AGREEMENT wild exchanges in a row agree with one another."""
        if self._wild and abs(entry.offset_ns - self._wild[-1].offset_ns) > WILD_S * 1e9:
            self._wild.clear()
        self._wild.append(entry)
        return len(self._wild) >= WILD_IN_AGREEMENT

    def _t(self, host_ns: HostNs) -> float:
        return (host_ns - self._ref_ns) * 1e-9

    def _seconds(self, entry: Exchange) -> float:
        return (entry.offset_ns - self._ref_offset_ns) * 1e-9
