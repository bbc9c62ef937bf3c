"""Errors that a target shares: with all targets of its vehicle, and with other vehicles that see the same ground."""

from __future__ import annotations

from math import sqrt

import numpy as np

from fwav_companion.estimation.errors import GIMBAL_HEADING, HEADING, LEAST_SIGMA, Array
from fwav_companion.estimation.live_filter import LiveFilter
from fwav_companion.types.tracks import CommonErrors

LEAST_SHARE = 1e-9
"""Least share of an error's variance that is counted as its own, beside the errors before it: rounding errors."""


def common_errors(live: LiveFilter | None, target: int) -> CommonErrors | None:
    """The shared errors of a target by the live filter; None where the filter does not hold it.

    With b the vehicle's errors now (position north and east, heading; reported minus true) of covariance L L^T, and C
    their covariance (2, 3) with the target's place, one sigma of each independent part of b displaces the place by
    -C L^-T: what the estimate of an error leaves of it has the opposite sign of the estimate's own error. Columns in
    the order of b, each over the whole sigma of its error, give the whole of what the errors explain.
    """
    if live is None or target not in live:
        return None
    rows = np.zeros((3, len(live.mean)))
    rows[0, live.error] = rows[1, live.error + 1] = rows[2, HEADING] = 1.0
    if live.size > GIMBAL_HEADING:
        rows[2, GIMBAL_HEADING] = 1.0
    covariance = rows @ live.covariance @ rows.T
    with_errors = live.cross(target) @ rows.T  # (3, 3): north, east, height of the target by b
    by_part = np.linalg.solve(_factor(covariance), with_errors.T).T  # (3, 3) metres by one sigma
    _, own = live.place(target)
    rest = own - by_part @ by_part.T
    height = rest[:, 2] / sqrt(max(float(rest[2, 2]), LEAST_SIGMA**2))  # (3,) metres by one sigma of its own height
    sigmas = np.sqrt(np.maximum(covariance.diagonal(), LEAST_SIGMA**2))
    columns = -by_part[:2] / sigmas
    return CommonErrors(
        sigmas=tuple(sigmas.tolist()),
        north=tuple(columns[0].tolist()),
        east=tuple(columns[1].tolist()),
        height=(float(height[0]), float(height[1])),
    )


def _factor(covariance: Array) -> Array:
    """Cholesky's factor (3, 3), lower, of a covariance that rounding may have left without full rank."""
    factor = np.zeros((3, 3))
    for j in range(3):
        left = covariance[j:, j] - factor[j:, :j] @ factor[j, :j]
        least = max(LEAST_SHARE * float(covariance[j, j]), LEAST_SIGMA**2)
        factor[j:, j] = left / sqrt(max(float(left[0]), least))
        factor[j, j] = sqrt(max(float(left[0]), least))
    return factor
