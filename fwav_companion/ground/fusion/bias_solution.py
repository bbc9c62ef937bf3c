"""Joint estimate of all targets and all vehicles' biases: weighted least squares with the targets eliminated. Pure.

Errors that vehicles may share are treated by split covariance intersection (Julier & Uhlmann 2001; Li & Nashashibi
2013): the shared covariance C of a track counts as C / w, with weights w of one target's tracks that add up to one. The
claim then holds for any correlation of the shared errors. If they are the same in all tracks, it is exact: K tracks
with weights 1 / K give C + N / K.

In numpy, with z = X + J b + e, cov(e) = M = N + C / w and b ~ (0, Sigma)::

    A = sum inv(M);  B = sum inv(M) J                                            # information of one target
    S = inv(Sigma) + sum J' inv(M) J - sum B' inv(A) B                           # information of the biases
    cov(b) = inv(S);  b = inv(S) (sum J' inv(M) z - sum B' inv(A) sum inv(M) z)
    X = inv(A) (sum inv(M) z - B b);  cov(X) = inv(A) + inv(A) B inv(S) B' inv(A)
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from fwav_companion.ground.fusion.reported_tracks import BIASES, Array, Indices, ReportedTrack

SMALLEST_SIGMA = 1e-4
"""Least prior sigma of a bias: keeps the equations regular if a vehicle states no sigma."""
NOISE_FLOOR_M2 = 0.01**2
CHUNK = 128
"""Targets whose covariances are computed at once."""


@dataclass(slots=True)
class BiasSolution:
    """Targets and biases, in the order in which they were given."""

    targets: Array
    """Positions, north and east, metres, one row a target."""
    target_covs: Array
    biases: Array
    """Estimated biases, one row a vehicle."""
    bias_covs: Array


def _blocks(eliminated: sparse.csr_array, bias_cov: Array, count: int) -> Generator[None, None, Array]:
    """inv(A) B cov(b) B' inv(A) of each target, (T, 2, 2); in chunks, as the dense product of all has gigabytes."""
    found = np.zeros((count, 2, 2))
    for first in range(0, count, CHUNK):
        yield
        share = eliminated[2 * first : 2 * min(first + CHUNK, count)]
        moved = share @ bias_cov  # (2 t, 3 V)
        even, odd = share[0::2], share[1::2]
        for i, row in enumerate((even, odd)):
            for j in range(2):
                found[first : first + CHUNK, i, j] = np.asarray(row.multiply(moved[j::2]).sum(axis=1)).ravel()
    return found


def intersection_weights(covs: Array, targets: Indices, count: int) -> Array:
    """Weight of each track among the tracks of its target: proportional to the inverse of its total variance."""
    information = 1.0 / np.trace(covs, axis1=1, axis2=2)
    weights: Array = information / np.bincount(targets, information, count)[targets]
    return weights


def finished(slices: Generator[None, None, BiasSolution]) -> BiasSolution:
    """The solution, without a pause."""
    while True:
        try:
            next(slices)
        except StopIteration as end:
            solution: BiasSolution = end.value
            return solution


def solution_slices(
    tracks: Sequence[ReportedTrack],
    positions: Array,
    *,
    vehicles: Indices,
    targets: Indices,
    sigmas: Array,
    target_count: int,
) -> Generator[None, None, BiasSolution]:
    """The joint solution. ``vehicles`` and ``targets``: index of each track's. ``sigmas``: one row a vehicle.

    It pauses between its products.
    """
    jacobians = np.array([track.jacobian for track in tracks])
    yield
    noise = np.array([track.noise for track in tracks]) + NOISE_FLOOR_M2 * np.eye(2)
    yield
    shared = np.array([track.shared for track in tracks])
    yield
    prior = np.maximum(sigmas, SMALLEST_SIGMA) ** -2.0
    own = jacobians @ (np.eye(BIASES) * (prior[vehicles] ** -1.0)[:, None, :]) @ jacobians.transpose(0, 2, 1)
    weights = intersection_weights(noise + shared + own, targets, target_count)
    yield
    information = np.linalg.inv(noise + shared / weights[:, None, None])
    count = len(sigmas)
    yield

    by_target = np.zeros((target_count, 2, 2))
    np.add.at(by_target, targets, information)
    target_spread = np.linalg.inv(by_target)
    weighted = np.einsum("mij,mj->mi", information, positions)
    target_sums = np.zeros((target_count, 2))
    np.add.at(target_sums, targets, weighted)

    yield
    to_bias = information @ jacobians
    # B of all targets below one another, (2 T, 3 V): a target is seen by few vehicles, so it is sparse.
    rows = (2 * targets[:, None] + np.arange(2))[:, :, None] + np.zeros(BIASES, np.intp)  # (M, 2, 3)
    columns = (BIASES * vehicles[:, None] + np.arange(BIASES))[:, None, :] + np.zeros((2, 1), np.intp)
    shape = (2 * target_count, BIASES * count)
    yield
    flat = sparse.csr_array((to_bias.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
    each_target = np.arange(target_count + 1)
    inverses = sparse.bsr_array((target_spread, each_target[:-1], each_target)).tocsr()

    yield
    system = np.zeros((count, BIASES, BIASES))
    np.add.at(system, vehicles, jacobians.transpose(0, 2, 1) @ to_bias)
    reduced = np.zeros((count * BIASES, count * BIASES))
    for index in range(count):
        at = slice(index * BIASES, (index + 1) * BIASES)
        reduced[at, at] = system[index] + np.diag(prior[index])
    yield
    eliminated = sparse.csr_array(inverses @ flat)  # inv(A) B, (2 T, 3 V)
    yield
    reduced -= (flat.T @ eliminated).toarray()
    yield

    right = np.zeros((count, BIASES))
    np.add.at(right, vehicles, np.einsum("mij,mi->mj", jacobians, weighted))
    right_flat = right.ravel() - eliminated.T @ target_sums.ravel()
    yield
    bias_cov = np.asarray(np.linalg.inv(reduced), np.float64)
    yield
    bias = bias_cov @ right_flat
    places = np.einsum("tij,tj->ti", target_spread, target_sums) - (eliminated @ bias).reshape(target_count, 2)
    covs = target_spread + (yield from _blocks(eliminated, bias_cov, target_count))
    blocks = bias_cov.reshape(count, BIASES, count, BIASES)
    each = np.arange(count)
    return BiasSolution(places, covs, bias.reshape(count, BIASES), blocks[each, :, each, :])
