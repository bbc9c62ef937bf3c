"""A single fix corrected by the joint estimate: the target relative to the vehicle now.

The joint estimate follows the error of the vehicle's position as far as that moves smoothly. Where it does not, an
estimate lags behind it by decimetres; the fix of this frame has the very error that the vehicle's report has. So it has
the delay of that report: at 5 m/s, 0.1 s of it displace every place by 0.5 m against the vehicle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_report import SharedParameter as Shared
from fwav_companion.types import Bias, GroundFix

if TYPE_CHECKING:
    from fwav_companion.self_calibration.assessment import CalibratedPlace
    from fwav_companion.self_calibration.calibrator import Calibrator

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


def fix_by(state: Calibrator, fix: GroundFix, placed: CalibratedPlace, claimed_m2: float) -> CalibratedFix | None:
    """A target relative to the vehicle at a fix: by the joint estimate along the smoothed path, or by the fix alone
    where its claim is the smaller one or a flight shows that the vehicle's position does not wander smoothly.

    None where neither claims less than ``claimed_m2``, the trace of the covariance known without this fix.
    """
    known, served = None if state.assessment is None else state.assessment.posterior, state.passes.served
    if known is None or served is None:
        return None
    position_m2 = state.context.priors.position_noise_m**2
    if served.wanders_quickly:
        return calibrated_fix(fix, *known, position_m2)
    best = _along_path(state, fix, placed)
    if best is not None and _trace(best) < claimed_m2:
        claimed_m2 = _trace(best)
    else:
        best = None
    if fix.noise_cov[0][0] + fix.noise_cov[1][1] - 2.0 * position_m2 >= claimed_m2:
        return best
    found = calibrated_fix(fix, *known, position_m2)
    return found if _trace(found) < claimed_m2 else best


def _trace(found: CalibratedFix) -> float:
    return found.cov[0] + found.cov[2]


def _along_path(state: Calibrator, fix: GroundFix, placed: CalibratedPlace) -> CalibratedFix | None:
    """The joint estimate's place in the frame of the vehicle's report: without the noise of that one report, which the
    smoothed path shows, and with the delay of the report, which the estimate holds.
    """
    vehicle = fix.sighting.state
    smoothed = state.context.smoothed_report(state.smoother, vehicle)
    if smoothed is None or vehicle.velocity_ned is None:
        return None
    (off_n, off_e), (var_n, var_e) = smoothed
    north, east, (nn, ne, ee) = placed.relative_to(vehicle.velocity_ned)
    return CalibratedFix(north + off_n, east + off_e, (nn + var_n, ne, ee + var_e))


def calibrated_fix(fix: GroundFix, mean: Array, cov: Array, position_noise_m2: float) -> CalibratedFix:
    """The fix without what the parameters by their ``mean`` (11 and more) and ``cov`` make of it."""
    rows = np.array([fix.bias_jacobian[i][:2] for i in BIASES]).T * SIGNS
    off = rows @ mean[SHARED]
    (nn, ne), (_, ee) = (rows @ cov[BLOCK] @ rows.T).tolist()
    (r_nn, r_ne, _), (_, r_ee, _), _ = fix.noise_cov
    by = (r_nn - position_noise_m2 + nn, r_ne + ne, r_ee - position_noise_m2 + ee)
    return CalibratedFix(fix.position_ned[0] - float(off[0]), fix.position_ned[1] - float(off[1]), by)
