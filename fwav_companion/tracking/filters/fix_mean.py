"""The fixes of about a second: their mean with the noise of the fixes alone, and the place by the gain of a filter."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.tracking.filters.consider_biases import Measurement
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate, first_point_estimate


class FixMean(msgspec.Struct, frozen=True, gc=False):
    """Mean of fixes, each weighed by the inverse of its variance."""

    weight: float
    """Sum of the weights, 1/m^2."""
    north_m: float
    east_m: float
    shared: tuple[Row, Row]
    """Mean of the rows of J sigma, metres."""
    spread: Symmetric2
    """Sum of the noises of the fixes, each times its weight squared, 1/m^2."""
    place: PointEstimate
    """The place by the gain of least total covariance, with the error of the sensitivities: for what biases do differs
    from fix to fix. On random directions, 20 fixes, the place by the mean was 1.61 m off, by this one 1.47 m."""

    @property
    def estimate(self) -> PointEstimate:
        """The mean with its noise."""
        scale, (nn, ne, ee) = 1.0 / (self.weight * self.weight), self.spread
        return PointEstimate(self.north_m, self.east_m, (scale * nn, scale * ne, scale * ee), self.shared)

    def with_fix(self, fix: Measurement, noise: Matrix3) -> FixMean:
        """The mean with one more fix. ``noise``: of the fix without the error of its sensitivities."""
        (nn, ne, _), (_, ee, _), _ = noise
        weight = 1.0 / (nn + ee)
        total, weight2 = self.weight + weight, weight * weight
        share, (s_nn, s_ne, s_ee), north, east = weight / total, self.spread, [], []
        for n, e, fix_n, fix_e in zip(*self.shared, *fix.shared[:2], strict=True):
            north.append(n + share * (fix_n - n))
            east.append(e + share * (fix_e - e))
        innovation = self.place.innovation(fix)
        return FixMean(
            total,
            self.north_m + share * (fix.position[0] - self.north_m),
            self.east_m + share * (fix.position[1] - self.east_m),
            (tuple(north), tuple(east)),
            (s_nn + weight2 * nn, s_ne + weight2 * ne, s_ee + weight2 * ee),
            self.place.update(innovation, innovation.gain),
        )


def first_mean(fix: Measurement, noise: Matrix3) -> FixMean:
    """The mean of one fix."""
    (nn, ne, _), (_, ee, _), _ = noise
    weight = 1.0 / (nn + ee)
    weight2 = weight * weight
    spread = (weight2 * nn, weight2 * ne, weight2 * ee)
    return FixMean(weight, fix.position[0], fix.position[1], fix.shared[:2], spread, first_point_estimate(fix))
