"""A single fix corrected by the joint estimate: the target relative to the vehicle now.

The joint estimate follows the error of the vehicle's position as far as that moves smoothly. Where it does not, an
estimate lags behind it by decimetres; the fix of this frame has the very error that the vehicle's report has. So it has
the delay of that report: at 5 m/s, 0.1 s of it displace every place by 0.5 m against the vehicle.
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
"""The biases of a fix that are the shared parameters, in their order. Columns of a fix are by a turn of the true mount
and by a late stamp, as the parameters are."""
SIGNS = np.array([-1.0 if each is Shared.READOUT else 1.0 for each in Shared])
"""The readout is truth minus configuration, its bias is the opposite."""
IN_REPORT = np.array([0.0 if each is Shared.POSITION_DELAY else sign for each, sign in zip(Shared, SIGNS, strict=True)])
"""The same of a fix relative to the vehicle's report: the age of positions moves both alike."""

AGREEING = 13.8
"""Squared Mahalanobis distance of a fix from its target along the path: a true one lies beyond once in 1000 times (2
degrees of freedom). On a late and crooked figure of eight a false detection in the gate lay at 33, all others below 1.
"""


class CalibratedFix(msgspec.Struct, frozen=True, gc=False):
    """Place of a target by one fix, in the frame of the vehicle's report at its capture."""

    north: float
    east: float
    cov: Symmetric2
    """m^2."""

    @property
    def claimed_m2(self) -> float:
        """Trace of the covariance."""
        return self.cov[0] + self.cov[2]

    def agrees_with(self, other: CalibratedFix) -> bool:
        """Whether both may be the same place. What they have in common makes their distance smaller than both claim."""
        (nn, ne, ee), (o_nn, o_ne, o_ee) = self.cov, other.cov
        cov = (nn + o_nn, ne + o_ne, ee + o_ee)
        return squared_distance(self.north - other.north, self.east - other.east, cov) < AGREEING


class KnownParameters(msgspec.Struct, frozen=True, gc=False):
    """Mean (11) and covariance of the parameters as biases of a fix, and the noise of the vehicle's report."""

    mean: Array
    cov: Array
    priors: ErrorPriors

    def claims(self, fixes: Sequence[GroundFix]) -> list[list[list[float]]]:
        """(N, 2, 2) covariance of fixes by the parameters alone, m^2.

        By the sensitivities at the stamps: right over a beat, too small for a fix that is stamped where the wing turns
        back and was captured where it is fast.
        """
        rows = _rows(fixes)
        claimed: list[list[list[float]]] = (rows @ self.cov @ rows.swapaxes(1, 2)).tolist()
        return claimed

    def linear(self, fix: GroundFix) -> tuple[float, float]:
        """North and east of a fix by the parameters, by its sensitivities at the nominal capture."""
        off_north, off_east = (_rows([fix])[0] @ self.mean).tolist()
        return fix.position_ned[0] - off_north, fix.position_ned[1] - off_east

    def noise(self, fix: GroundFix, smoothed: SmoothedReport | None) -> Symmetric2:
        """Noise of a fix relative to the vehicle, m^2; with the height of the smoothed path, where that is reported."""
        (nn, ne, _), (_, ee, _), _ = fix.noise_cov
        position = self.priors.position_noise_m**2
        less, (north, east, _) = 0.0, fix.bias_jacobian[Bias.HEIGHT]
        if smoothed is not None and fix.ground not in RANGED:
            less = self.priors.height_noise_m**2 - smoothed[1][2]
        return nn - position - less * north * north, ne - less * north * east, ee - position - less * east * east


def without_height_noise(
    fix: GroundFix, place: tuple[float, float], smoothed: SmoothedReport | None
) -> tuple[float, float]:
    """The place (north, east) of a fix without the noise of the reported height, where the smoothed path shows it.

    That noise, 0.3 m, moves a target 4 m aside of a camera 14 m up by 0.09 m.
    """
    if smoothed is None or fix.ground in RANGED:
        return place
    north, east, _ = fix.bias_jacobian[Bias.HEIGHT]
    return place[0] + smoothed[0][2] * north, place[1] + smoothed[0][2] * east


def known_parameters(mean: Array, cov: Array, priors: ErrorPriors) -> KnownParameters:
    """The parameters by their ``mean`` (11 and more) and ``cov``."""
    mean, cov = mean[: len(Shared)] * IN_REPORT, cov[: len(Shared), : len(Shared)] * IN_REPORT * IN_REPORT[:, None]
    return KnownParameters(mean, cov, priors)


def _rows(fixes: Sequence[GroundFix]) -> Array:
    """(N, 2, 11) change of fixes by the biases that are the shared parameters."""
    return np.array([BIASES_OF(fix.bias_jacobian) for fix in fixes])[..., :2].swapaxes(1, 2)
