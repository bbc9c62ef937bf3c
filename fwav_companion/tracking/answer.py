"""What of a joint estimate may be believed: observability decides what may move.

An unknown that the flight has not shown keeps its prior, and every target is then estimated as if that unknown were
what it was configured to be, with its whole prior in the claimed covariance: exactly what a filter without
self-calibration does. Only what is well seen is let go, and then it corrects the targets.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import msgspec

from fwav_companion.tracking.joint import Joint
from fwav_companion.tracking.linear import inner
from fwav_companion.tracking.rays import COMMON_COUNT, Common

MOUNT = (Common.MOUNT_X, Common.MOUNT_Y, Common.MOUNT_Z)
CONSIDERED = (Common.NORTH, Common.EAST)
"""Never estimated, so never held either: their share is in the covariance as it stands."""


class Held(msgspec.Struct, frozen=True):
    """A joint estimate with some of its unknowns held at their priors."""

    joint: Joint
    held: tuple[int, ...]
    doubts: tuple[float, ...]
    """One sigma of each of those, for claims."""
    factor: tuple[tuple[float, ...], ...]
    """Cholesky factor of the held unknowns' posterior covariance."""

    weights: tuple[float, ...]
    """Of the crossed covariances in the shift of a mean: posterior covariance^-1 (posterior - prior mean)."""

    def mean(self, place: int) -> float:
        """Of one of the joint's unknowns that is not held."""
        row = self.joint.cov[place]
        return self.joint.mean[place] - sum([row[i] * w for i, w in zip(self.held, self.weights, strict=True)])

    def cov(self, places: Sequence[int], *, doubted: bool = True) -> list[list[float]]:
        """Covariance of some of the joint's unknowns, none of them held.

        ``doubted``: with the whole prior of what is held; otherwise as if what is held were right.
        """
        joint, held = self.joint, self.held
        crossed = [[joint.cov[place][i] for i in held] for place in places]
        pulls = [solved(self.factor, row) for row in crossed]
        prior2 = [doubt * doubt if doubted else 0.0 for doubt in self.doubts]
        changes = [
            [pulled * prior - was for pulled, prior, was in zip(pull, prior2, row, strict=True)]
            for pull, row in zip(pulls, crossed, strict=True)
        ]
        return [
            [joint.cov[p][q] + inner(pull, change) for q, change in zip(places, changes, strict=True)]
            for p, pull in zip(places, pulls, strict=True)
        ]

    def about(self, joint: Joint, prior_means: tuple[float, ...]) -> Held:
        """A newer joint estimate with the same unknowns held."""
        return _held(joint, self.held, self.doubts, prior_means)

    def undoubting(self, unknown: int) -> Held:
        """The same, where the answer is told as if this unknown, which is held, were right."""
        doubts = tuple(0.0 if i == unknown else doubt for i, doubt in zip(self.held, self.doubts, strict=True))
        return msgspec.structs.replace(self, doubts=doubts)

    def known_sigma(self, place: int) -> float:
        """One sigma as far as the flight has shown it, the held unknowns taken as right."""
        return sqrt(max(0.0, self.cov([place], doubted=False)[0][0]))


def holding(joint: Joint, held: Sequence[int], prior_means: tuple[float, ...], prior_sigmas: tuple[float, ...]) -> Held:
    """The joint estimate with these unknowns held; those that have no prior at all are certain anyway."""
    uncertain = tuple(i for i in held if prior_sigmas[i] > 0.0)
    return _held(joint, uncertain, tuple(prior_sigmas[i] for i in uncertain), prior_means)


def _held(joint: Joint, held: tuple[int, ...], doubts: tuple[float, ...], prior_means: tuple[float, ...]) -> Held:
    factor = cholesky([[joint.cov[i][j] for j in held] for i in held])
    weights = solved(factor, [joint.mean[i] - prior_means[i] for i in held])
    return Held(joint, held, doubts, factor, tuple(weights))


def cholesky(m: Sequence[Sequence[float]]) -> tuple[tuple[float, ...], ...]:
    """Lower factor of a symmetric positive definite matrix; a pivot lost to rounding is kept at 1e-12 of itself."""
    factor: list[tuple[float, ...]] = []
    for i, row in enumerate(m):
        line: list[float] = []
        for value, above in zip(row, factor, strict=False):
            line.append((value - inner(line, above)) / above[-1])
        pivot = row[i] - inner(line, line)
        line.append(sqrt(max(pivot, 1e-12 * row[i], 1e-300)))
        factor.append(tuple(line))
    return tuple(factor)


def solved(factor: Sequence[Sequence[float]], right: Sequence[float]) -> list[float]:
    """X of L L' x = right."""
    x: list[float] = []
    for value, line in zip(right, factor, strict=True):
        x.append((value - inner(line, x)) / line[-1])
    for i in reversed(range(len(x))):
        line = factor[i]
        x[i] = last = x[i] / line[i]
        x[:i] = [value - share * last for value, share in zip(x[:i], line, strict=False)]
    return x


def all_but(released: Sequence[int]) -> tuple[int, ...]:
    """The common unknowns that stay held."""
    return tuple(i for i in range(COMMON_COUNT) if i not in released and i not in CONSIDERED)
