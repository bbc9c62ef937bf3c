"""A single fix corrected by the joint estimate: the place of a target relative to the vehicle at the fix's capture.

The joint estimate follows the error of the vehicle's position as far as that error moves smoothly. Where it does not,
the estimate lags behind it by decimetres, but the fix of this frame has the same error as the vehicle's report. The fix
also has the delay of that report: at 5 m/s, a delay of 0.1 s displaces every place by 0.5 m against the vehicle.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter

import msgspec
import numpy as np

from fwav_companion.geometry.small_matrices import Symmetric2, squared_distance
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_report import SharedParameter as Shared
from fwav_companion.self_calibration.measurement_batch import RANGED
from fwav_companion.self_calibration.position_path import SmoothedReport
from fwav_companion.types import Bias, ErrorPriors, GroundFix

BIASES_OF = itemgetter(
    *(Bias.TIME_OFFSET, Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z, Bias.HEADING, Bias.HEIGHT, Bias.READOUT),
    *(Bias.POSITION_DELAY, Bias.LEVER_X, Bias.LEVER_Y, Bias.LEVER_Z),
)
"""Getter of the biases of a fix that are the shared parameters, in their order. The fix's columns are sensitivities to
a rotation of the true mount and to a late stamp, as the parameters are."""
SIGNS = np.array([-1.0 if each is Shared.READOUT else 1.0 for each in Shared])
"""Sign of each shared parameter as a bias: the readout parameter is truth minus configuration, its bias the
opposite."""
IN_REPORT = np.array([0.0 if each is Shared.POSITION_DELAY else sign for each, sign in zip(Shared, SIGNS, strict=True)])
"""SIGNS for a fix relative to the vehicle's report; 0 for the age of positions, which moves fix and report alike."""

AGREEING = 13.8
"""Gate on the squared Mahalanobis distance between a fix and its target along the path, 2 degrees of freedom: a true
fix exceeds it once in 1000 times. On a late and crooked figure of eight a false detection in the gate was at 33, all
others below 1."""


class CalibratedFix(msgspec.Struct, frozen=True, gc=False):
    """Place of a target relative to the vehicle's report at one capture, shifted as if that report were exact."""

    north: float
    east: float
    cov: Symmetric2
    """m^2."""

    @property
    def claimed_m2(self) -> float:
        """Trace of the covariance, m^2."""
        return self.cov[0] + self.cov[2]

    def agrees_with(self, other: CalibratedFix) -> bool:
        """Whether both may be the same place. Errors common to both make their distance smaller than both claim."""
        (nn, ne, ee), (o_nn, o_ne, o_ee) = self.cov, other.cov
        cov = (nn + o_nn, ne + o_ne, ee + o_ee)
        return squared_distance(self.north - other.north, self.east - other.east, cov) < AGREEING


class KnownParameters(msgspec.Struct, frozen=True, gc=False):
    """Mean (11) and covariance of the shared parameters as biases of a fix, and the noise of the vehicle's report."""

    mean: Array
    cov: Array
    priors: ErrorPriors

    def claims(self, fixes: Sequence[GroundFix]) -> list[list[list[float]]]:
        """(N, 2, 2) covariance of fixes by the parameters' uncertainty alone, m^2.

        It uses the sensitivities at the stamps. They are right on average over a beat, but too small for a fix that is
        stamped where the wing turns back and was captured where it is fast.
        """
        rows = bias_rows(fixes)
        claimed: list[list[list[float]]] = (rows @ self.cov @ rows.swapaxes(1, 2)).tolist()
        return claimed

    def linear(self, fix: GroundFix) -> tuple[float, float]:
        """North and east of a fix corrected by the parameters, to first order about the nominal capture."""
        off_north, off_east = (bias_rows([fix])[0] @ self.mean).tolist()
        return fix.position_ned[0] - off_north, fix.position_ned[1] - off_east

    def noise(self, fix: GroundFix, smoothed: SmoothedReport | None) -> Symmetric2:
        """Noise covariance of a fix relative to the vehicle, m^2; with a smoothed path, by the height of that path."""
        (nn, ne, _), (_, ee, _), _ = fix.noise_cov
        position = self.priors.position_noise_m**2
        less, (north, east, _) = 0.0, fix.bias_jacobian[Bias.HEIGHT]
        if smoothed is not None and fix.ground not in RANGED:
            less = self.priors.height_noise_m**2 - smoothed[1][2]
        return nn - position - less * north * north, ne - less * north * east, ee - position - less * east * east


def without_height_noise(
    fix: GroundFix, place: tuple[float, float], smoothed: SmoothedReport | None
) -> tuple[float, float]:
    """The place (north, east) of a fix without the noise of the reported height, if the smoothed path shows that noise.

    Height noise of 0.3 m moves a target 4 m aside of a camera 14 m up by 0.09 m.
    """
    if smoothed is None or fix.ground in RANGED:
        return place
    north, east, _ = fix.bias_jacobian[Bias.HEIGHT]
    return place[0] + smoothed[0][2] * north, place[1] + smoothed[0][2] * east


def known_parameters(mean: Array, cov: Array, priors: ErrorPriors) -> KnownParameters:
    """The shared parameters of a joint estimate with this ``mean`` (11 or more) and ``cov``."""
    mean, cov = mean[: len(Shared)] * IN_REPORT, cov[: len(Shared), : len(Shared)] * IN_REPORT * IN_REPORT[:, None]
    return KnownParameters(mean, cov, priors)


def bias_rows(fixes: Sequence[GroundFix]) -> Array:
    """(N, 2, 11) sensitivities of fixes to the biases that are the shared parameters."""
    return np.array([BIASES_OF(fix.bias_jacobian) for fix in fixes])[..., :2].swapaxes(1, 2)
