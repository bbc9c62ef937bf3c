"""The widest band between the envelopes of the exchanges: offset and rate by maximum likelihood. Seconds.

Each exchange bounds the offset on both sides, because no delay is shorter than the least one. Where delays are a least
delay, common to both directions, and an exponential tail, the log-likelihood of a line is n / tail times the width of
the band about it that no bound enters. So the best line is the middle of the widest band. Single fast requests and
single fast answers decide it, even where no exchange was fast both ways: of 64 exchanges with tails of 10 ms the error
is 0.1 ms, that of a fit weighted by round trips 0.7 ms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from fwav_companion.telemetry.clock.exchange_fit import Exchange

LEAST_TAIL_S = 2e-5
"""Least mean of a tail, s: microseconds are not resolved by the stamps."""
STEPS = 32
"""Golden sections of the skew: of 4e-3 a ten-millionth is left."""
GOLDEN = 0.6180339887498949

Point = tuple[float, float]


class Band(NamedTuple):
    """The widest band of some exchanges."""

    offset: float
    """Middle at the newest exchange."""
    skew: float
    width: float
    """Least delays of both directions together, by this line; negative where the bounds cross."""
    tail: float
    """Mean of a delay's tail."""
    number: int
    """Number of the exchanges."""

    def worse_by(self, width: float) -> float:
        """Log-likelihood by which these exchanges prefer a band of that width; negative where this one is wider."""
        return self.number * (width - self.width) / self.tail


def widest_band(exchanges: Sequence[Exchange], skew: float, sigma: float, near: float, reach: float) -> Band:
    """The band of the likeliest line under the prior N(``skew``, ``sigma``^2), skew within ``reach`` of ``near``."""
    end, count = exchanges[-1].t, len(exchanges)
    upper = _lower_hull([(e.t - end, e.offset + 0.5 * e.trip + e.beside) for e in exchanges])
    # The upper hull of the lower bounds, mirrored.
    lower = _lower_hull([(e.t - end, 0.5 * e.trip + e.beside - e.offset) for e in exchanges])
    trips = [e.trip for e in exchanges]
    tail = max(LEAST_TAIL_S, 0.5 * (sum(trips) / count - min(trips)))
    weight, information = count / tail, 0.5 / (sigma * sigma)

    def likelihood(s: float) -> float:
        width = min([y - s * t for t, y in upper]) + min([y + s * t for t, y in lower])
        return weight * width - information * (s - skew) ** 2

    best = _maximum(likelihood, near - reach, near + reach)
    high, low = min([y - best * t for t, y in upper]), -min([y + best * t for t, y in lower])
    return Band(0.5 * (high + low), best, high - low, tail, count)


def _maximum(of: Callable[[float], float], low: float, high: float) -> float:
    """Place of the maximum of a concave function by golden sections."""
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_left, at_right = of(left), of(right)
    for _ in range(STEPS):
        if at_left < at_right:
            low, left, at_left = left, right, at_right
            right = low + GOLDEN * (high - low)
            at_right = of(right)
        else:
            high, right, at_right = right, left, at_left
            left = high - GOLDEN * (high - low)
            at_left = of(left)
    return 0.5 * (low + high)


def _lower_hull(points: Sequence[Point]) -> list[Point]:
    """Lower convex hull of points in order of time (Andrew 1979)."""
    hull: list[Point] = []
    for t, y in points:
        while len(hull) >= 2:
            (t1, y1), (t2, y2) = hull[-2], hull[-1]
            if (t2 - t1) * (y - y1) > (y2 - y1) * (t - t1):
                break
            hull.pop()
        hull.append((t, y))
    return hull
