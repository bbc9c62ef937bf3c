"""A single fix corrected by the joint estimate: the target relative to the vehicle now.

The joint estimate follows the error of the vehicle's position as far as that moves smoothly. Where it does not, an
estimate lags behind it by decimetres; the fix of this frame has the very error that the vehicle's report has. So it has
the delay of that report: at 5 m/s, 0.1 s of it displace every place by 0.5 m against the vehicle.
"""

from __future__ import annotations

import msgspec
import numpy as np

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_report import SharedParameter as Shared
from fwav_companion.types import Bias, GroundFix

COLUMNS = (
    (Shared.DELAY, Bias.TIME_OFFSET, 1.0),
    (Shared.MOUNT_X, Bias.MOUNT_X, 1.0),
    (Shared.MOUNT_Y, Bias.MOUNT_Y, 1.0),
    (Shared.MOUNT_Z, Bias.MOUNT_Z, 1.0),
    (Shared.HEADING, Bias.HEADING, 1.0),
    (Shared.HEIGHT, Bias.HEIGHT, 1.0),
    (Shared.READOUT, Bias.READOUT, -1.0),
    (Shared.LEVER_X, Bias.LEVER_X, 1.0),
    (Shared.LEVER_Y, Bias.LEVER_Y, 1.0),
    (Shared.LEVER_Z, Bias.LEVER_Z, 1.0),
)
"""Parameters, the biases of a fix that they are, and the sign of these. Columns of a fix are by a turn of the true
mount and by a late stamp, as the parameters are; the readout is truth minus configuration, its bias is the opposite.
The age of positions moves fix and report alike."""
SHARED, BIASES = [int(each) for each, _, _ in COLUMNS], [int(bias) for _, bias, _ in COLUMNS]
SIGNS = np.array([sign for _, _, sign in COLUMNS])
BLOCK = np.ix_(SHARED, SHARED)
"""Index of these parameters in a covariance."""


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


class KnownParameters(msgspec.Struct, frozen=True, gc=False):
    """Mean (10) and covariance of the parameters as biases of a fix, and the noise that the vehicle's report shares."""

    mean: Array
    cov: Array
    position_noise_m2: float

    def corrected(self, fix: GroundFix) -> CalibratedFix:
        """The fix without what the parameters make of it."""
        jacobian = fix.bias_jacobian
        rows = np.array([jacobian[i] for i in BIASES])[:, :2].T
        off_north, off_east = (rows @ self.mean).tolist()
        (nn, ne), (_, ee) = (rows @ self.cov @ rows.T).tolist()
        (r_nn, r_ne, _), (_, r_ee, _), _ = fix.noise_cov
        by = (r_nn - self.position_noise_m2 + nn, r_ne + ne, r_ee - self.position_noise_m2 + ee)
        return CalibratedFix(fix.position_ned[0] - off_north, fix.position_ned[1] - off_east, by)


def known_parameters(mean: Array, cov: Array, position_noise_m: float) -> KnownParameters:
    """The parameters by their ``mean`` (11 and more) and ``cov``."""
    return KnownParameters(mean[SHARED] * SIGNS, cov[BLOCK] * SIGNS * SIGNS[:, None], position_noise_m**2)


def fix_by(
    fix: GroundFix, known: KnownParameters, along_path: CalibratedFix | None, claimed_m2: float
) -> CalibratedFix | None:
    """A target relative to the vehicle at a fix: by the joint estimate along the smoothed path, or by the fix alone
    where its claim is the smaller one.

    None where neither claims less than ``claimed_m2``, the trace of the covariance known without this fix.
    """
    best = None if along_path is None or along_path.claimed_m2 >= claimed_m2 else along_path
    least_m2 = claimed_m2 if best is None else best.claimed_m2
    if fix.noise_cov[0][0] + fix.noise_cov[1][1] - 2.0 * known.position_noise_m2 >= least_m2:
        return best
    found = known.corrected(fix)
    return found if found.claimed_m2 < least_m2 else best
