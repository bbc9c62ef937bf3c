"""Covariances of a joint estimate under other assumptions: known parameters, or noisier measurements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_report import SharedParameter
from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT

MOUNT_AXES = (SharedParameter.MOUNT_X, SharedParameter.MOUNT_Y, SharedParameter.MOUNT_Z)
NUISANCE = (SharedParameter.HEADING, SharedParameter.POSITION_DELAY, *list(SharedParameter)[SharedParameter.LEVER_X :])
"""Parameters that a flight hardly separates from the mount, and that no report states. They are estimated with the
mount by their priors, so that the covariance of the mount includes them."""
TIMING = (SharedParameter.DELAY, SharedParameter.READOUT)
"""Parameters of time: the readout is a delay of the later rows. Fast shaking shows both, slow drift neither."""


CAUSES = {
    "time": (SharedParameter.DELAY,),
    "mount": MOUNT_AXES,
    "heading": (SharedParameter.HEADING,),
    "height": (SharedParameter.HEIGHT,),
    "readout": (SharedParameter.READOUT,),
    "position_delay": (SharedParameter.POSITION_DELAY,),
    "lever_arm": (SharedParameter.LEVER_X, SharedParameter.LEVER_Y, SharedParameter.LEVER_Z),
}
"""Shared parameters of each cause of error."""


def bias_shares(joint: JointFilter, track: int) -> dict[str, float]:
    """Horizontal variance of a target by cause of error, m^2: the reduction if that cause were exactly known.

    The three angles of the mount count together, as do the position's states and the lever arm. With the covariance P,
    target t and group g: trace(P[t, g] inv(P[g, g]) P[g, t]).
    """
    place, cov = joint.place_of(track), joint.cov[0]
    if place is None:
        return {}
    shares = dict[str, float]()
    for cause, group in {**CAUSES, "position": range(SHARED_COUNT, joint.first)}.items():
        known = [int(i) for i in group if cov[i, i] > 0.0]
        white = whitened(block(cov, known), cov[known, place : place + 2]) if known else np.zeros(1)
        shares[cause] = float((white * white).sum())
    return shares


def given(mean: Array, cov: Array, known: Sequence[int], values: Array) -> tuple[Array, Array]:
    """Mean and covariance conditioned on known values of some states; states without variance are left out.

    With c = P[:, k] inv(P[k, k])::

        mean - c (mean[k] - values);  P - c P[k, :]
    """
    used = [j for j, i in enumerate(known) if cov[i, i] > 0.0]
    if not used:
        return mean, cov
    k = [known[j] for j in used]
    crossed, off = cov[k], (mean[k] - values[used])[:, None]
    white = whitened(block(cov, k), np.concatenate((crossed, off), 1))
    gain = white[:, :-1].T
    return np.asarray(mean - gain @ white[:, -1]), np.asarray(cov - gain @ gain.T)


def root_given(cov: Array, known: Sequence[int], wanted: Sequence[int]) -> Array:
    """Cholesky factor of the covariance of the ``wanted`` states conditioned on the ``known`` ones.

    It is the last block of the factor of both together.
    """
    used = [i for i in known if cov[i, i] > 0.0]
    return lower_root(block(cov, [*used, *wanted]))[len(used) :, len(used) :]


def block(cov: Array, index: Sequence[int]) -> Array:
    """Block of a covariance: rows and columns of some states."""
    i = [int(each) for each in index]
    return np.asarray(cov[i][:, i])


def with_drift(joint: JointFilter, sigmas: Array, factor: float) -> Array:
    """Covariance of a joint estimate if every measurement had ``factor`` times its variance, with the same priors and
    the same error of the vehicle's position.

    (prior^-1 + information / k)^-1 is k times the covariance after another measurement of each prior with the variance
    prior / (k - 1).
    """
    cov: Array = joint.cov[0]
    if factor <= 1.0:
        return cov
    free = [i for i in range(SHARED_COUNT) if sigmas[i] > 0.0]
    known = [*range(SHARED_COUNT, joint.first), *free]
    widened = block(cov, known)
    last = np.arange(len(known) - len(free), len(known))
    widened[last, last] += sigmas[free] ** 2 / (factor - 1.0)
    rows = whitened(widened, cov[known])
    own = rows[last]
    return np.asarray(cov + (factor - 1.0) * (cov - rows.T @ rows) - own.T @ own)


def lower_root(matrix: Array) -> Array:
    """Cholesky factor of a covariance whose scales differ. Scaled eigenvalues that rounding lost become 1e-12."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    try:
        return np.asarray(scale[:, None] * np.linalg.cholesky(matrix / scale / scale[:, None]))
    except np.linalg.LinAlgError:
        values, axes = np.linalg.eigh(matrix / scale / scale[:, None])
        root = np.asarray(np.linalg.qr((axes * np.sqrt(np.maximum(values, 1e-12))).T, mode="r")).T
        return np.asarray(scale[:, None] * root)


def whitened(matrix: Array, right: Array) -> Array:
    """inv(L) @ right, with the Cholesky factor L of the covariance ``matrix``."""
    return np.asarray(np.linalg.solve(lower_root(matrix), right))
