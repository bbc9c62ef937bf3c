"""Joint estimates with the parameters that the flight does not show held at their priors.

A held parameter keeps its prior, and every target is estimated as if that parameter were as configured, with its whole
prior in the claimed covariance: what a filter without self-calibration does. Only observable parameters are estimated,
and then they correct the targets.
"""

from __future__ import annotations

from collections.abc import Collection

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_report import SharedParameter
from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT

MOUNT_AXES = (SharedParameter.MOUNT_X, SharedParameter.MOUNT_Y, SharedParameter.MOUNT_Z)
POSITION = (SharedParameter.NORTH, SharedParameter.EAST)
"""Considered: never estimated, so never held either; their share is part of the covariance."""
NUISANCE = (SharedParameter.HEADING, SharedParameter.POSITION_DELAY, *list(SharedParameter)[SharedParameter.LEVER_X :])
"""Parameters that a flight hardly separates from the mount, and that no report states: estimated with the mount by
their priors, so that the claims of the mount hold them."""
TIMING = (SharedParameter.DELAY, SharedParameter.READOUT)
"""A delay of the later rows is a delay, too. Fast shaking shows both: slow drift says nothing of them."""


class ConstrainedEstimate(msgspec.Struct, frozen=True):
    """A joint estimate with some of its parameters held at their priors; arrays by the joint estimate's indices."""

    joint: JointFilter
    held: tuple[int, ...]
    mean: Array
    cov: Array
    """Covariance with the whole prior of what is held; of parameters that are not held."""
    known_cov: Array
    """The same as if the held parameters were right."""
    drift: Array
    """Covariance to add because the innovations drift (:class:`InnovationConsistency`)."""

    def claimed(self, places: Collection[int]) -> Array:
        """Covariance of some parameters with all that is added."""
        i = np.ix_(list(places), list(places))
        return np.asarray(self.cov[i] + self.drift[i])

    def sigma(self, place: int, *, known: bool = False) -> float:
        """One sigma of a parameter; ``known``: as the flight shows it, the held parameters taken as right."""
        variance = (self.known_cov if known else self.cov)[place, place]
        return float(np.sqrt(max(0.0, variance + (0.0 if place in TIMING else self.drift[place, place]))))


def held_at_priors(
    joint: JointFilter, held: Collection[int], priors: tuple[Array, Array], wider: float = 1.0, trusted: int = -1
) -> ConstrainedEstimate:
    """The joint estimate with these parameters held; parameters without a prior are certain anyway.

    ``priors``: means and one sigma (13). ``wider``: factor of the variance of what the flight contributed.
    ``trusted``: a held parameter whose prior the claims leave out.

    With the covariance P, its blocks by h (held) and c = P[:, h] inv(P[h, h])::

        mean - c (mean[h] - prior mean);  known_cov = P - c P[h, :];  cov = known_cov + c diag(prior^2) c'
    """
    means, sigmas = priors
    mean, cov = joint.mean[0], joint.cov[0]
    uncertain = [i for i in range(SHARED_COUNT) if sigmas[i] > 0.0 and i not in POSITION]
    kept = [i for i in uncertain if i in held]
    free = [i for i in uncertain if i not in held and i not in TIMING]
    drift = np.zeros_like(cov) if wider == 1.0 else _drift(cov, kept, free, sigmas, wider - 1.0)
    if not kept:
        return ConstrainedEstimate(joint, (), mean, cov, cov, drift)
    crossed = cov[:, kept]
    pull = solved(cov[np.ix_(kept, kept)], crossed.T).T
    doubt = np.where(np.array(kept) == trusted, 0.0, sigmas[kept] ** 2)
    known = cov - pull @ crossed.T
    return ConstrainedEstimate(
        joint, tuple(kept), mean - pull @ (mean[kept] - means[kept]), known + (pull * doubt) @ pull.T, known, drift
    )


def _drift(cov: Array, held: list[int], free: list[int], sigmas: Array, more: float) -> Array:
    """The covariance to add where every measurement has 1 + ``more`` times its variance; priors and the vehicle's
    position are as they were.

    (prior^-1 + information / k)^-1 is k times the covariance after another measurement of each prior with the variance
    prior / (k - 1).
    """
    known = [*held, *(i for i in POSITION if cov[i, i] > 0.0), *free]
    block = cov[np.ix_(known, known)].copy()
    last = np.arange(len(known) - len(free), len(known))
    block[last, last] += sigmas[free] ** 2 / more
    rows = np.linalg.solve(lower_root(block), cov[known])
    own = rows[last]
    return np.asarray(more * (cov - rows.T @ rows) - own.T @ own)


def lower_root(matrix: Array) -> Array:
    """Cholesky factor of a covariance whose scales differ, with a pivot that rounding lost kept at 1e-12 of itself."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    try:
        return np.asarray(scale[:, None] * np.linalg.cholesky(matrix / scale / scale[:, None]))
    except np.linalg.LinAlgError:
        values, axes = np.linalg.eigh(matrix / scale / scale[:, None])
        root = np.asarray(np.linalg.qr((axes * np.sqrt(np.maximum(values, 1e-12))).T, mode="r")).T
        return np.asarray(scale[:, None] * root)


def solved(matrix: Array, right: Array) -> Array:
    """X of matrix @ x = right, for a covariance."""
    root = lower_root(matrix)
    return np.asarray(np.linalg.solve(root.T, np.linalg.solve(root, right)))


def all_but(released: Collection[int]) -> tuple[int, ...]:
    """The shared parameters that stay held."""
    return tuple(i for i in range(SHARED_COUNT) if i not in released and i not in POSITION)
