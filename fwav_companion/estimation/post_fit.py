"""What a Gauss-Newton step leaves of each sighting, and how far that is from what all others predict."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.errors import Array
from fwav_companion.estimation.information import WeightedSightings, is_used
from fwav_companion.estimation.problem import Problem
from fwav_companion.estimation.robust_weights import LeaveOneOut, leave_one_out

_UNUSED_VARIANCE = 1e6  # of a sighting that counts nothing, standardised


class PostFit(NamedTuple):
    """What a Gauss-Newton step leaves of each sighting."""

    residual: Array  # (2, N) standardised
    known: Array  # (2, 2, N) covariance of its prediction by all sightings, itself among them


def post_fit(problem: Problem, rows: Array, residual: Array, step: Array, covariance: Array) -> PostFit:
    """Residuals after a step (n,) with the covariance (n, n) of all unknowns, linearised; rows: (2, o + 6, N)."""
    o, width, count = problem.errors_at, rows.shape[1], len(problem.s)
    order, edges = problem.by_gap  # sightings between the same two knots follow each other
    if order is not None:
        rows, residual = rows.take(order, -1), residual.take(order, -1)
    h = np.ascontiguousarray(rows.transpose(1, 2, 0)).reshape(width, -1)  # (o + 6, 2 N)
    carried, fitted = np.empty_like(h), np.empty(2 * count)
    first, near = np.arange(o), o + np.arange(6)
    for gap, begin, end in edges:
        index, of_gap = np.concatenate([first, near + 3 * gap]), slice(2 * begin, 2 * end)
        carried[:, of_gap] = covariance[index[:, None], index] @ h[:, of_gap]
        fitted[of_gap] = step[index] @ h[:, of_gap]
    c = np.ascontiguousarray(carried.reshape(width, count, 2).transpose(2, 0, 1))  # (2, o + 6, N)
    known = np.empty((2, 2, count))
    known[0, 0], known[1, 1] = np.add.reduce(rows[0] * c[0], 0), np.add.reduce(rows[1] * c[1], 0)
    known[0, 1] = known[1, 0] = np.add.reduce(rows[0] * c[1], 0)
    left = residual - fitted.reshape(count, 2).T
    if order is not None:
        left[:, order], known[..., order] = left.copy(), known.copy()
    return PostFit(left, known)


def judge_sightings(problem: Problem, weighted: WeightedSightings, after: PostFit) -> LeaveOneOut:
    """All sightings against what the others predict, also those that count nothing now."""
    noise = np.einsum("ian,jan->ijn", weighted.common, weighted.common)
    noise[0, 0] += 1.0
    noise[1, 1] += 1.0
    weight = np.where(is_used(problem, weighted), weighted.weight, 1.0 / _UNUSED_VARIANCE)
    return leave_one_out(after.residual, after.known, noise, weight)
