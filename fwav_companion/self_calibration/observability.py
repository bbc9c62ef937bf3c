"""What of a joint estimate may be believed: observability decides what may move.

An unknown that the flight has not shown keeps its prior, and every target is then estimated as if that unknown were
what it was configured to be, with its whole prior in the claimed covariance: exactly what a filter without
self-calibration does. Only what is well seen is let go, and then it corrects the targets.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import msgspec

from fwav_companion.geometry.small_matrices import inner
from fwav_companion.self_calibration.joint_filter import JointFilter, Rows
from fwav_companion.self_calibration.pixel_measurement import COMMON_COUNT, SharedParameter

MOUNT = (SharedParameter.MOUNT_X, SharedParameter.MOUNT_Y, SharedParameter.MOUNT_Z)
CONSIDERED = (SharedParameter.NORTH, SharedParameter.EAST)
"""Never estimated, so never held either: their share is in the covariance as it stands."""
TIMING = (SharedParameter.DELAY, SharedParameter.READOUT)
"""A delay of the rows below the first is one, too. What shakes many times a second shows them: what drifts over seconds
says nothing of them.
"""


class ConstrainedEstimate(msgspec.Struct, frozen=True):
    """A joint estimate with some of its unknowns held at their priors."""

    joint: JointFilter
    held: tuple[int, ...]
    doubts: tuple[float, ...]
    """One sigma of each of those, for claims."""
    let_go: tuple[int, ...]
    """The other unknowns that have a prior, but for timing."""
    priors: tuple[float, ...]
    """One sigma of each of those."""
    wider: float
    """Factor of the variance of what the flight has taught (``Drift``)."""
    factor: Rows
    """Cholesky factor of the posterior covariance of the held, and after them of what bounds a wider one."""
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
        if not held:
            return [[joint.cov[p][q] for q in places] for p in places]
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

    def drifting(self, places: Sequence[int]) -> list[list[float]]:
        """What is to be added to their covariance, since what the flight has taught is wider by its factor.

        As if every measurement had so many times the variance; priors, and the vehicle's position, are as they were.
        """
        if self.wider == 1.0:
            return [[0.0] * len(places) for _ in places]
        joint, more, first = self.joint, self.wider - 1.0, len(self.factor) - len(self.let_go)
        known = self._known
        rows = [forward(self.factor, [joint.cov[place][i] for i in known]) for place in places]
        return [
            [
                more * (joint.cov[p][q] - inner(row, column)) - inner(row[first:], column[first:])
                for q, column in zip(places, rows, strict=True)
            ]
            for p, row in zip(places, rows, strict=True)
        ]

    def claimed(self, places: Sequence[int]) -> list[list[float]]:
        """Covariance with all that is to be added."""
        pairs = zip(self.cov(places), self.drifting(places), strict=True)
        return [[a + b for a, b in zip(row, more, strict=True)] for row, more in pairs]

    def sigma(self, place: int) -> float:
        """One sigma of an unknown, as it is claimed."""
        cov = self.cov([place]) if place in TIMING else self.claimed([place])
        return sqrt(max(0.0, cov[0][0]))

    def about(self, joint: JointFilter, prior_means: tuple[float, ...]) -> ConstrainedEstimate:
        """A newer joint estimate with the same unknowns held; what is to be added to it is not asked each frame."""
        return _held(msgspec.structs.replace(self, joint=joint, wider=1.0), prior_means)

    def undoubting(self, unknown: int) -> ConstrainedEstimate:
        """The same, where the answer is told as if this unknown, which is held, were right."""
        doubts = tuple(0.0 if i == unknown else doubt for i, doubt in zip(self.held, self.doubts, strict=True))
        return msgspec.structs.replace(self, doubts=doubts)

    def known_sigma(self, place: int) -> float:
        """The same as far as the flight has shown it, the held unknowns taken as right."""
        more = 0.0 if place in TIMING else self.drifting([place])[0][0]
        return sqrt(max(0.0, self.cov([place], doubted=False)[0][0] + more))

    @property
    def _known(self) -> tuple[int, ...]:
        """Whose covariance is factorized."""
        if self.wider == 1.0:
            return self.held
        return (*self.held, *(i for i in CONSIDERED if self.joint.cov[i][i] > 0.0), *self.let_go)


def holding(
    joint: JointFilter,
    held: Sequence[int],
    prior_means: tuple[float, ...],
    prior_sigmas: tuple[float, ...],
    wider: float = 1.0,
) -> ConstrainedEstimate:
    """The joint estimate with these unknowns held; those that have no prior at all are certain anyway.

    ``wider``: factor of the variance of what the flight has taught.
    """
    uncertain = [i for i in range(COMMON_COUNT) if prior_sigmas[i] > 0.0 and i not in CONSIDERED]
    kept = tuple(i for i in uncertain if i in held)
    let_go = tuple(i for i in uncertain if i not in held and i not in TIMING)
    doubts, priors = (tuple(prior_sigmas[i] for i in each) for each in (kept, let_go))
    return _held(ConstrainedEstimate(joint, kept, doubts, let_go, priors, wider, (), ()), prior_means)


def _held(blank: ConstrainedEstimate, prior_means: tuple[float, ...]) -> ConstrainedEstimate:
    """With the factor and weights of its joint estimate.

    Measurements of k times the variance: (prior^-1 + information / k)^-1, which is k times the covariance as it stands
    after one more look at each prior, of the variance prior / (k - 1).
    """
    joint, known = blank.joint, blank._known
    block = [[joint.cov[i][j] for j in known] for i in known]
    if blank.wider > 1.0:
        for i, sigma in enumerate(blank.priors, len(known) - len(blank.let_go)):
            block[i][i] += sigma * sigma / (blank.wider - 1.0)
    factor = cholesky(block)
    weights = solved(factor, [joint.mean[i] - prior_means[i] for i in blank.held])
    return msgspec.structs.replace(blank, factor=factor, weights=tuple(weights))


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
    x = forward(factor, right)
    for i in reversed(range(len(x))):
        line = factor[i]
        x[i] = last = x[i] / line[i]
        x[:i] = [value - share * last for value, share in zip(x[:i], line, strict=False)]
    return x


def forward(factor: Sequence[Sequence[float]], right: Sequence[float]) -> list[float]:
    """X of L x = right, by as many rows of L as the right side has."""
    x: list[float] = []
    for value, line in zip(right, factor, strict=False):
        x.append((value - inner(line, x)) / line[-1])
    return x


def all_but(released: Sequence[int]) -> tuple[int, ...]:
    """The common unknowns that stay held."""
    return tuple(i for i in range(COMMON_COUNT) if i not in released and i not in CONSIDERED)
