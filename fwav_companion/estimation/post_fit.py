"""What a Gauss-Newton step leaves of each sighting, and how far that is from what all others predict."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.errors import Array
from fwav_companion.estimation.information import WeightedSightings, is_used
from fwav_companion.estimation.problem import Problem
from fwav_companion.estimation.robust_weights import leave_one_out_distance2

_UNUSED_VARIANCE = 1e6  # of a sighting that counts nothing, standardised


class PostFit(NamedTuple):
    """What a Gauss-Newton step leaves of each sighting."""

    residual: Array  # (2, N) standardised
    known: Array  # (2, 2, N) covariance of its prediction by all sightings, itself among them


def post_fit(problem: Problem, rows: Array, residual: Array, step: Array, covariance: Array) -> PostFit:
    """Residuals after a step (n,) with the covariance (n, n) of all unknowns, linearised; rows: (2, o + 6, N)."""
    o, count = problem.errors_at, len(problem.s)
    left, known = np.empty((2, count)), np.empty((2, 2, count))
    first, near = np.arange(o), o + np.arange(6)
    for gap in np.unique(problem.left).tolist():
        i = np.flatnonzero(problem.left == gap)
        index = np.concatenate([first, near + 3 * gap])
        h = rows.take(i, -1)  # (2, o + 6, n)
        left[:, i] = residual[:, i] - np.tensordot(step[index], h, (0, 1))
        carried = np.tensordot(covariance[index[:, None], index], h, (1, 1))  # (o + 6, 2, n)
        known[..., i] = np.einsum("awn,wbn->abn", h, carried)
    return PostFit(left, known)


def judge_sightings(problem: Problem, weighted: WeightedSightings, after: PostFit) -> Array:
    """Squared distances (N,) of all sightings, also of those that count nothing now."""
    noise = np.einsum("ian,jan->ijn", weighted.common, weighted.common)
    noise[0, 0] += 1.0
    noise[1, 1] += 1.0
    weight = np.where(is_used(problem, weighted), weighted.weight, 1.0 / _UNUSED_VARIANCE)
    return leave_one_out_distance2(after.residual, after.known, noise, weight)
