"""Predicted measurements of a frame: residuals of pairs and their joint innovation covariance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.errors import Array, Bools, Ints

GATE2 = 18.0  # squared distance of a pair that is still used: 99.99 % of two dimensions


@dataclass(frozen=True)
class FramePrediction:
    """M pairs of a detection and a target; rows of matrices: all first components, then all second ones."""

    detection: Ints  # (M,) index in the frame
    target: Ints  # (M,)
    residual: Array  # (2 M,) standardised, observed minus predicted
    covariance: Array  # (2 M, 2 M) joint: with the noise and the errors that the frame's pairs share
    distance2: Array  # (M,) squared, of each pair alone
    log_det: Array  # (M,) of each pair's own covariance
    visible: Bools  # (M,)

    def rows(self, pairs: Ints) -> Ints:
        """Rows of pairs in the residual and the covariance."""
        return np.concatenate([pairs, pairs + len(self.target)])

    def given(self, pairs: Ints) -> FramePrediction:
        """The prediction when these pairs are known to be right: what they show of the shared errors is known, too.

        Other pairs of the same detections or targets keep a residual that agrees with no displacement of the frame.
        """
        rows = self.rows(pairs)
        cross = self.covariance[:, rows]  # (2 M, 2 P)
        gain = np.linalg.solve(self.covariance[rows[:, None], rows], cross.T).T
        residual, covariance = self.residual - gain @ self.residual[rows], self.covariance - gain @ cross.T
        m = len(self.target)
        diagonal = np.arange(2 * m)
        known = np.zeros(m, np.bool_)
        known[pairs] = True
        covariance[diagonal, diagonal] += np.tile(known, 2) * 1.0  # of themselves nothing is left
        distance2, log_det = pair_distances(residual, covariance)
        return FramePrediction(
            self.detection, self.target, residual, covariance, np.where(known, self.distance2, distance2),
            np.where(known, self.log_det, log_det), self.visible,
        )  # fmt: skip

    def unambiguous(self, among: Bools) -> Ints:
        """Pairs in the gate whose detection and target have no other pair in the gate, among those of a mask (M,)."""
        gated = np.flatnonzero(self.visible & (self.distance2 < GATE2) & among)
        detection, target = self.detection[gated], self.target[gated]
        one = (detection[:, None] == detection).sum(0) == 1
        other = (target[:, None] == target).sum(0) == 1
        return np.asarray(gated[one & other])


class LinearisedPairs(NamedTuple):
    """Pairs of a frame's detections and targets, linearised once at the live filter's means then."""

    detection: Ints  # (M,) index in the frame
    target: Ints  # (M,)
    residual: Array  # (2, M) standardised, observed minus predicted
    visible: Bools  # (M,)
    base: Array  # (2, M, n) derivatives by the base state
    own: Array  # (2, 3, M) derivatives by the target's place
    noise: Array  # (2, M, k) what the frame's pairs share, one sigma each
    mean: Array  # (n,) base state
    places: Array  # (3, M)

    def select(self, pairs: Ints) -> LinearisedPairs:
        """These pairs alone."""
        return LinearisedPairs(
            self.detection[pairs], self.target[pairs], self.residual[:, pairs], self.visible[pairs],
            self.base[:, pairs], self.own[..., pairs], self.noise[:, pairs], self.mean, self.places[:, pairs],
        )  # fmt: skip

    def of(self, detection: Ints, targets: Ints) -> LinearisedPairs | None:
        """The pairs of these detections and targets (P,); None where one is not among them."""
        at = {pair: i for i, pair in enumerate(zip(self.detection.tolist(), self.target.tolist(), strict=True))}
        pairs = [at.get(pair, -1) for pair in zip(detection.tolist(), targets.tolist(), strict=True)]
        if -1 in pairs:
            return None
        return self if pairs == [*range(len(at))] else self.select(np.array(pairs, np.int64))


def pair_distances(residual: Array, covariance: Array) -> tuple[Array, Array]:
    """Squared distances (M,) of pairs, each by its own two rows, and their covariances' log determinants (M,)."""
    m = len(residual) // 2
    u, v = residual[:m], residual[m:]
    d = covariance.diagonal()
    a, b, c = d[:m], covariance[:m, m:].diagonal(), d[m:]
    det = a * c - b * b
    return (u * u * c - 2.0 * u * v * b + v * v * a) / det, np.log(det)
