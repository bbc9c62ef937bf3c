"""Averages of the fixes of about one second: their mean with the noise of the fixes alone, and a filtered place."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.tracking.filters.consider_biases import Measurement
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate, first_point_estimate


class FixMean(msgspec.Struct, frozen=True, gc=False):
    """Mean of fixes, each weighted by the inverse of its variance, and the place that a filter estimates from them."""

    weight: float
    """Sum of the weights, 1/m^2."""
    mean: PointEstimate
    place: PointEstimate
    """The place by the gain of least total covariance. Its noise includes the error of the sensitivities, because the
    effect of the biases differs from fix to fix. On random directions, 20 fixes, the mean as the place was 1.61 m off,
    this one 1.47 m."""

    def with_fix(self, fix: Measurement, noise: Matrix3) -> FixMean:
        """The mean with one more fix. ``noise``: covariance of the fix without the error of its sensitivities, m^2."""
        weight = 1.0 / (noise[0][0] + noise[1][1])
        total, innovation = self.weight + weight, self.place.innovation(fix)
        return FixMean(
            total, self.mean.mixed(fix, noise, weight / total), self.place.update(innovation, innovation.gain)
        )


def first_mean(fix: Measurement, noise: Matrix3) -> FixMean:
    """The mean of one fix."""
    weight = 1.0 / (noise[0][0] + noise[1][1])
    return FixMean(weight, first_point_estimate(fix, noise), first_point_estimate(fix))
