"""Which kind of wander the fixes of a target show: the vehicle's position moves smoothly, or as a first-order process.

With the same sigma and time constant, 1 m and 60 s, the first-order error moves by 0.18 m within a second and the
smooth one by 0.03 m. A filter that supposes the smooth one averages the biases of a turning vehicle over several
seconds: on circles with a first-order error its normalised squares, 2 when honest, were 3.2. No report states the kind,
so means of one second each decide, by a sequential likelihood ratio (Wald 1945).

The test takes second differences. A constant rate cancels in them, and what the biases do on a turn is the smaller
part: in circles of 9 s a mount off by 1 degree at 14 m gives 0.11 m, the first-order error 0.18 m. The bias is the same
in all of them, and two sigma of it look like the first-order error: the mistake is then on the side of the wider claim.
"""

from __future__ import annotations

from math import log
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2, gram
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate

MOST_APART_S = 3.0
"""Interval between two means up to which the error's movement is the greater part of their difference."""
MARGIN = -0.5
"""Log-likelihood ratio from which the error is taken for smooth. Receivers and autopilots smooth: before any fix
the odds are five to three."""
MOST_SCORE = 10.0
"""Bound of the sum, so that a receiver that behaves differently from now on is believed within seconds."""
SHARE = 0.5
"""Share of each log-likelihood ratio in the sum: successive second differences have two of their three means in common.
"""

Mean: TypeAlias = tuple[PointEstimate, float]
"""Mean of the fixes of a second, and the interval since the one before, seconds."""


class WanderEvidence(msgspec.Struct, frozen=True, gc=False):
    """Sum of the log-likelihood ratios of a smooth error over a first-order one, and the last two means."""

    score: float = 0.0
    last: Mean | None = None
    before: Mean | None = None

    @property
    def is_smooth(self) -> bool:
        """Whether the error is taken for smooth; else the wider claim holds."""
        return self.score >= MARGIN

    def with_mean(
        self, mean: PointEstimate, interval_s: float, quick_density: float, smooth_density: float
    ) -> WanderEvidence:
        """The evidence with the mean of one more second.

        ``quick_density``: of the first-order error's rate, m^2/s; ``smooth_density``: of the smooth error's
        acceleration, m^2/s^3.
        """
        if interval_s > MOST_APART_S:
            return WanderEvidence(self.score, (mean, interval_s))
        newest = (mean, interval_s)
        if self.last is None or self.before is None:
            return WanderEvidence(self.score, newest, self.last)
        last, last_s = self.last
        ratio = interval_s / last_s
        north, east, cov = _second_difference(mean, last, self.before[0], ratio)
        quick = _log_likelihood(north, east, cov, 0.5 * quick_density * (interval_s + ratio * ratio * last_s))
        smooth = _log_likelihood(north, east, cov, smooth_density * interval_s**3)
        score = self.score + SHARE * (smooth - quick)
        return WanderEvidence(max(-MOST_SCORE, min(MOST_SCORE, score)), newest, self.last)


def _second_difference(
    newest: PointEstimate, middle: PointEstimate, oldest: PointEstimate, ratio: float
) -> tuple[float, float, Symmetric2]:
    """Newest less the extrapolation of the others; its covariance by noise and biases. ``ratio``: of the intervals."""
    twice = 1.0 + ratio
    noise = [
        a + twice * twice * b + ratio * ratio * c
        for a, b, c in zip(newest.noise, middle.noise, oldest.noise, strict=True)
    ]
    rows: list[Row] = [
        tuple([a - twice * b + ratio * c for a, b, c in zip(*each, strict=True)])
        for each in zip(newest.shared, middle.shared, oldest.shared, strict=True)
    ]
    nn, ne, ee = gram(rows[0], rows[1])
    return (
        newest.north_m - twice * middle.north_m + ratio * oldest.north_m,
        newest.east_m - twice * middle.east_m + ratio * oldest.east_m,
        (noise[0] + nn, noise[1] + ne, noise[2] + ee),
    )


def _log_likelihood(north: float, east: float, cov: Symmetric2, more: float) -> float:
    """Of a difference with this covariance and ``more`` variance along each axis, up to a constant."""
    nn, ne, ee = cov[0] + more, cov[1], cov[2] + more
    area2 = nn * ee - ne * ne
    return -0.5 * (log(area2) + (ee * north * north - 2.0 * ne * north * east + nn * east * east) / area2)
