"""Normal equations of weighted sightings, with the noise that a frame's sightings share divided out.

The covariance of one frame's residuals is D + G G' with D = diag(1 / weight) and the common noise G (2 M, 7). Its
inverse by the matrix inversion lemma (Woodbury 1950) costs 7 x 7 for each frame, however many sightings it has.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.errors import Array, Bools, Ints
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.measurement import Projection
from fwav_companion.estimation.problem import Problem

_LEAST_WEIGHT = 0.02  # below it a sighting is left out


class WeightedSightings(NamedTuple):
    """Sightings with their noise under one kernel."""

    common: Array  # (2, 7, N) standardised, one sigma each
    distance2: Array  # (N,) squared, in standard deviations
    weight: Array  # (N,) 0 to 1


class SightingInformation(NamedTuple):
    """Information of the sightings, without priors."""

    information: Array  # (n, n)
    right: Array  # (n,)
    squares: float  # of the residuals
    log_determinant: float  # of the noise


def own_inverse(common: Array, variance: Array) -> tuple[Array, Array]:
    """Inverse (2, 2, N) and determinant (N,) of each sighting's covariance: common (2, 7, N), variance (N,)."""
    a = (common[0] * common[0]).sum(0) + variance
    b = (common[0] * common[1]).sum(0)
    c = (common[1] * common[1]).sum(0) + variance
    det = a * c - b * b
    inverse = np.empty((2, 2, len(det)))
    inverse[0, 0], inverse[1, 1] = c / det, a / det
    inverse[0, 1] = inverse[1, 0] = -b / det
    return inverse, det


def sighting_rows(problem: Problem, projection: Projection) -> Array:
    """Derivatives (2, o + 6, N) of all sightings by shared, targets and the two knots about each."""
    o, size, point = problem.errors_at, problem.shared_size, projection.point
    count = point.shape[-1]
    rows = np.zeros((2, o + 6, count))
    rows[:, :size] = projection.shared
    # A place that moves uphill also rises.
    place = point[:, :2] + point[:, 2:] * problem.slope
    at, n = size + TARGET_SIZE * problem.of_target, np.arange(count)
    rows[:, at, n], rows[:, at + 1, n], rows[:, at + 2, n] = place[:, 0], place[:, 1], point[:, 2]
    rows[:, o : o + 3], rows[:, o + 3 :] = point * (1.0 - problem.part), point * problem.part
    return rows


def is_used(problem: Problem, weighted: WeightedSightings) -> Bools:
    """Mask (N,) of the sightings that count at all."""
    return np.asarray((weighted.weight > _LEAST_WEIGHT) & problem.usable)


def normal_equations(
    problem: Problem, projection: Projection, weighted: WeightedSightings, rows: Array | None = None
) -> SightingInformation:
    """Sum over all usable sightings. rows: `sighting_rows`, where they are known."""
    use = np.flatnonzero(is_used(problem, weighted))
    o = problem.errors_at
    rows = sighting_rows(problem, projection) if rows is None else rows
    every = np.concatenate([rows, projection.residual[:, None]], 1).take(use, -1)
    common = weighted.common.take(use, -1)
    divided, log_det = _divide_by_noise(every, common, weighted.weight[use], problem.s.frame[use])
    parts, left = _sum_over_gaps(every, divided, problem.left[use])
    information, right = _scatter(parts, left, o, len(problem.knots))
    return SightingInformation(information, right, float(parts[:, -1, -1].sum()), log_det)


def _divide_by_noise(rows: Array, common: Array, weight: Array, frame: Ints) -> tuple[Array, float]:
    """Products (2, width, N) of the frames' inverse covariances and rows, and the covariances' log determinant."""
    if not len(frame):
        return rows.copy(), 0.0
    start = np.flatnonzero(np.concatenate([[True], frame[1:] != frame[:-1]]))
    count = np.diff(np.append(start, len(frame)))
    single = np.repeat(count == 1, count)
    if single.all():
        return _divide_single(rows, common, weight)
    out, log_det = np.empty_like(rows), 0.0
    if single.any():
        i = np.flatnonzero(single)
        out[..., i], log_det = _divide_single(rows.take(i, -1), common.take(i, -1), weight[i])
    i = np.flatnonzero(~single)
    out[..., i], more = _divide_shared(rows.take(i, -1), common.take(i, -1), weight[i], count[count > 1])
    return out, log_det + more


def _divide_single(rows: Array, common: Array, weight: Array) -> tuple[Array, float]:
    inverse, det = own_inverse(common, 1.0 / weight)
    return inverse[:, :1] * rows[0] + inverse[:, 1:] * rows[1], float(np.log(det).sum())


def _divide_shared(rows: Array, common: Array, weight: Array, count: Ints) -> tuple[Array, float]:
    """Frames of several sightings: count (F,) of each, in order."""
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    of_frame = np.repeat(np.arange(len(count)), count)
    g = common * weight  # (2, 7, N)
    inner = np.add.reduceat(np.einsum("ian,ibn->abn", g, common), start, axis=-1).transpose(2, 0, 1)  # (F, 7, 7)
    inner = inner + np.eye(common.shape[1])
    seen = np.add.reduceat(np.einsum("ian,icn->acn", g, rows), start, axis=-1).transpose(2, 0, 1)  # (F, 7, width)
    solved = np.linalg.solve(inner, seen).transpose(1, 2, 0)  # (7, width, F)
    out = rows * weight - np.einsum("ian,acn->icn", g, solved.take(of_frame, -1))
    log_det = float(np.linalg.slogdet(inner)[1].sum()) - 2.0 * float(np.log(weight).sum())
    return np.asarray(out), log_det


def _sum_over_gaps(rows: Array, divided: Array, left: Ints) -> tuple[Array, Ints]:
    """Products (gaps, width, width) of the sightings between the same two knots, and the left knot of each."""
    width = rows.shape[1]
    if not len(left):
        return np.zeros((0, width, width)), left
    if (np.diff(left) < 0).any():  # rows of a rolling shutter come back to a gap
        order = np.argsort(left, kind="stable")
        rows, divided, left = rows.take(order, -1), divided.take(order, -1), left[order]
    edges = np.concatenate([[0], np.flatnonzero(np.diff(left)) + 1, [len(left)]])
    parts = np.empty((len(edges) - 1, width, width))
    a, b = (np.ascontiguousarray(x.transpose(1, 2, 0)).reshape(width, -1) for x in (rows, divided))
    for i, (first, end) in enumerate(zip((2 * edges[:-1]).tolist(), (2 * edges[1:]).tolist(), strict=True)):
        np.matmul(a[:, first:end], b[:, first:end].T, out=parts[i])
    return parts, left[edges[:-1]]


def _scatter(parts: Array, left: Ints, o: int, knots: int) -> tuple[Array, Array]:
    """One matrix (n, n) and its right-hand side (n,) from the gaps' products; a gap has two knots."""
    n = o + 3 * knots
    information, right = np.zeros((n, n)), np.zeros(n)
    total = parts[:, :o].sum(0)
    information[:o, :o], right[:o] = total[:, :o], total[:, -1]
    cross = np.zeros((knots, 3, o + 1))  # knots with shared and targets, and the right-hand side
    between = np.zeros((knots, knots, 3, 3))
    for a in (0, 1):
        rows = parts[:, o + 3 * a : o + 3 * a + 3]
        cross[left + a] += rows[:, :, np.append(np.arange(o), -1)]
        for b in (0, 1):
            between[left + a, left + b] += rows[:, :, o + 3 * b : o + 3 * b + 3]
    information[o:, o:] = between.transpose(0, 2, 1, 3).reshape(3 * knots, 3 * knots)
    information[o:, :o] = cross[:, :, :o].reshape(3 * knots, o)
    information[:o, o:] = information[o:, :o].T
    right[o:] = cross[:, :, o].ravel()
    return information, right
