"""What of a joint estimate may be believed: observability decides what may move.

An unknown that the flight has not shown keeps its prior, and every target is then estimated as if that unknown were
what it was configured to be, with its whole prior in the claimed covariance: exactly what a filter without
self-calibration does. Only what is well seen is let go, and then it corrects the targets.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import msgspec

from fwav_companion.tracking.joint import Joint, Rows
from fwav_companion.tracking.linear import inner
from fwav_companion.tracking.rays import COMMON_COUNT, Common

MOUNT = (Common.MOUNT_X, Common.MOUNT_Y, Common.MOUNT_Z)
CONSIDERED = (Common.NORTH, Common.EAST)
"""Never estimated, so never held either: their share is in the covariance as it stands."""
TIMING = (Common.DELAY, Common.READOUT)
"""A delay of the rows below the first is one, too. What shakes many times a second shows them: what drifts over seconds
says nothing of them.
"""


class Held(msgspec.Struct, frozen=True):
    """A joint estimate with some of its unknowns held at their priors."""

    joint: Joint
    held: tuple[int, ...]
    doubts: tuple[float, ...]
    """One sigma of each of those, for claims."""
    let_go: tuple[int, ...]
    """Unknowns with a prior that what the flight has taught may move by its drift."""
    priors: tuple[float, ...]
    """One sigma of each of those."""
    wider: float
    """Factor of the variance of what the flight has taught."""
    factor: Rows
    """Cholesky factor of the covariance of the held, of the considered, and of those let go, in this order: of the
    latter with their priors once more, for a wider posterior is bounded by them.
    """
    weights: tuple[float, ...]
    """Of the crossed covariances in the shift of a mean: posterior covariance^-1 (posterior - prior mean)."""

    def mean(self, place: int) -> float:
        """Of one of the joint's unknowns that is not held."""
        row = self.joint.cov[place]
        return self.joint.mean[place] - sum([row[i] * w for i, w in zip(self.held, self.weights, strict=True)])

    def cov(self, places: Sequence[int], *, doubted: bool = True, drifting: bool = True) -> list[list[float]]:
        """Covariance of some of the joint's unknowns, none of them held.

        ``doubted``: with the whole prior of what is held; otherwise as if what is held were right. ``drifting``: what
        the flight has taught is as much less certain as it drifts; the vehicle's position, which is considered, and
        priors are not.
        """
        joint, wandering, wider = self.joint, considered(self.joint), self.wider if drifting else 1.0
        held, known = len(self.held), len(self.held) + len(wandering)
        asked = (*self.held, *wandering, *(self.let_go if wider > 1.0 else ()))
        crossed = [forward(self.factor, [joint.cov[place][i] for i in asked]) for place in places]
        priors = [doubt if doubted else 0.0 for doubt in self.doubts]
        pulls = [[x * prior for x, prior in zip(back(self.factor, row[:held]), priors, strict=True)] for row in crossed]
        return [
            [
                wider * (joint.cov[p][q] - inner(row, column))
                + inner(row[held:known], column[held:known])
                + inner(pull, other)
                for q, column, other in zip(places, crossed, pulls, strict=True)
            ]
            for p, row, pull in zip(places, crossed, pulls, strict=True)
        ]

    def about(self, joint: Joint, prior_means: tuple[float, ...]) -> Held:
        """A newer joint estimate with the same unknowns held."""
        return _held(joint, self, prior_means)

    def undoubting(self, unknown: int) -> Held:
        """The same, where the answer is told as if this unknown, which is held, were right."""
        doubts = tuple(0.0 if i == unknown else doubt for i, doubt in zip(self.held, self.doubts, strict=True))
        return msgspec.structs.replace(self, doubts=doubts)

    def sigma(self, place: int) -> float:
        """One sigma of an unknown."""
        return sqrt(max(0.0, self.cov([place], drifting=place not in TIMING)[0][0]))

    def known_sigma(self, place: int) -> float:
        """The same as far as the flight has shown it, the held unknowns taken as right."""
        return sqrt(max(0.0, self.cov([place], doubted=False, drifting=place not in TIMING)[0][0]))


def holding(
    joint: Joint,
    held: Sequence[int],
    prior_means: tuple[float, ...],
    prior_sigmas: tuple[float, ...],
    wider: float = 1.0,
) -> Held:
    """The joint estimate with these unknowns held; those that have no prior at all are certain anyway.

    ``wider``: factor of the variance of what the flight has taught.
    """
    uncertain = [i for i in range(COMMON_COUNT) if prior_sigmas[i] > 0.0 and i not in CONSIDERED]
    kept = tuple(i for i in uncertain if i in held)
    let_go = tuple(i for i in uncertain if i not in held and i not in TIMING)
    sigmas = [tuple(prior_sigmas[i] for i in each) for each in (kept, let_go)]
    return _held(joint, Held(joint, kept, sigmas[0], let_go, sigmas[1], wider, (), ()), prior_means)


def _held(joint: Joint, like: Held, prior_means: tuple[float, ...]) -> Held:
    order = (*like.held, *considered(joint), *(like.let_go if like.wider > 1.0 else ()))
    block = [[joint.cov[i][j] for j in order] for i in order]
    if like.wider > 1.0:
        for i, sigma in enumerate(like.priors, len(order) - len(like.let_go)):
            block[i][i] += sigma * sigma / (like.wider - 1.0)
    factor = cholesky(block)
    weights = solved(factor, [joint.mean[i] - prior_means[i] for i in like.held])
    return msgspec.structs.replace(like, joint=joint, factor=factor, weights=tuple(weights))


def considered(joint: Joint) -> tuple[int, ...]:
    """What is only considered, where it has any error at all."""
    return tuple(i for i in CONSIDERED if joint.cov[i][i] > 0.0)


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
    """X of L L' x = right, by as many rows of L as the right side has."""
    return back(factor, forward(factor, right))


def forward(factor: Sequence[Sequence[float]], right: Sequence[float]) -> list[float]:
    """X of L x = right, by as many rows of L as the right side has."""
    x: list[float] = []
    for value, line in zip(right, factor, strict=False):
        x.append((value - inner(line, x)) / line[-1])
    return x


def back(factor: Sequence[Sequence[float]], right: Sequence[float]) -> list[float]:
    """X of L' x = right, by as many rows of L as the right side has."""
    x = list(right)
    for i in reversed(range(len(x))):
        line = factor[i]
        x[i] = last = x[i] / line[i]
        x[:i] = [value - share * last for value, share in zip(x[:i], line, strict=False)]
    return x


def all_but(released: Sequence[int]) -> tuple[int, ...]:
    """The common unknowns that stay held."""
    return tuple(i for i in range(COMMON_COUNT) if i not in released and i not in CONSIDERED)
