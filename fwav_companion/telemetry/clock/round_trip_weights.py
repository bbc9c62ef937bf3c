"""Weights of exchanges by their round trips, with a variance model that is fitted to the exchanges themselves.

The variance is modelled as ``scale * (floor^2 + excess^2)``. The excess is the round trip minus the least one. The
likeliest floor is chosen: small where delays have long tails, large where they scatter evenly.
"""

from __future__ import annotations

from math import log, pi, sqrt
from operator import truediv
from typing import TypeAlias

SKEW_PRIOR = 300e-6
"""One sigma of the skew before the fit: half of the largest skew."""
RESOLUTION_S = 5e-6
"""Resolution of an offset, s: whole microseconds on both sides, and the time that reading the two clocks takes."""
_FLOORS = (0.03, 0.06, 0.12, 0.2, 0.4, 0.8, 1.6, 3.2, 100.0)
"""Floors of the variance model, in median excesses; the last means that errors do not depend on the round trip."""

Fit: TypeAlias = tuple[float, float, float, float, float]
"""(offset s, skew) at time 0 and their covariance (00, 01, 11)."""


class RoundTripWeights:
    """Variance model of exchanges. Before it is learned, an error is uniform in its bound, half the round trip either
    way.
    """

    __slots__ = ("_floor_s", "_least_s", "_scale")

    def __init__(self) -> None:
        self._least_s, self._floor_s, self._scale = 0.0, 0.0, 1.0 / 12.0

    def learn_least(self, trips: list[float]) -> None:
        """Estimate the least possible round trip: the k-th least of n sums of two long-tailed delays lies about sqrt(k)
        above it.
        """
        least = sorted(trips)[:4]
        self._least_s = max(0.0, 2.0 * least[0] - least[3])

    def excesses(self, trips: list[float]) -> list[float]:
        """Excesses of round trips over the least one, seconds."""
        return [max(0.0, trip - self._least_s) for trip in trips]

    def learn(self, times: list[float], offsets: list[float], excesses: list[float]) -> None:
        """Choose the likeliest floor of the variance model, and its scale, from the residuals of the line so far."""
        level, skew, *_ = self.line(times, offsets, excesses)
        residuals2 = [(y - level - skew * t) ** 2 for t, y in zip(times, offsets, strict=True)]
        middle = max(RESOLUTION_S, sorted(excesses)[len(excesses) // 2])
        excesses2, best = [x * x for x in excesses], -1e300
        for factor in _FLOORS:
            floor2 = (factor * middle) ** 2
            shapes = [floor2 + x2 for x2 in excesses2]
            scale = sum(map(truediv, residuals2, shapes)) / (len(shapes) - 2)
            scale = max(scale, RESOLUTION_S**2 / shapes[-1], 1e-12)
            likelihood = -0.5 * (len(shapes) * log(scale) + sum(map(log, shapes)))
            if likelihood > best:
                best, self._floor_s, self._scale = likelihood, sqrt(floor2), scale

    def of(self, excess: float) -> float:
        """Inverse variance of an offset, 1/s^2."""
        return 1.0 / (self._scale * (self._floor_s**2 + excess * excess) + RESOLUTION_S**2)

    def line(self, times: list[float], offsets: list[float], excesses: list[float]) -> Fit:
        """Likeliest line through the offsets, under the prior on skew."""
        floor2, scale, resolution2 = self._floor_s**2, self._scale, RESOLUTION_S**2
        s0 = s1 = s2 = b0 = b1 = 0.0
        for t, y, x in zip(times, offsets, excesses, strict=True):
            w = 1.0 / (scale * (floor2 + x * x) + resolution2)  # as `of`, inlined: four hundred of them in a fit
            wt = w * t
            s0 += w
            s1 += wt
            s2 += wt * t
            b0 += w * y
            b1 += wt * y
        s2 += 1.0 / SKEW_PRIOR**2
        d = s0 * s2 - s1 * s1
        return ((s2 * b0 - s1 * b1) / d, (s0 * b1 - s1 * b0) / d, s2 / d, -s1 / d, s0 / d)

    def log_likelihood(self, fit: Fit, times: list[float], offsets: list[float], excesses: list[float]) -> float:
        """Log likelihood of the offsets about a weighted line."""
        level, skew, *_ = fit
        weights = [self.of(x) for x in excesses]
        squares = [w * (y - level - skew * t) ** 2 for w, t, y in zip(weights, times, offsets, strict=True)]
        return 0.5 * (sum(map(log, weights)) - len(weights) * log(2.0 * pi) - sum(squares))
