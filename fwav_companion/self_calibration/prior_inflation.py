"""Priors that a flight denies: widened to what it says, instead of bending everything else.

A height above a home that was set metres off, or a mount that somebody moved, lies many sigma outside of [uncertainty].
An unknown held there, or pulled there, would be told as another one: a height as a mount off by degrees, and every
target with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, sqrt

import msgspec

from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.observability import CONSIDERED, MOUNT
from fwav_companion.self_calibration.pixel_measurement import SharedParameter

DENIED = 4.0
"""Sigma between what was configured and what was found, at which one of the two is wrong."""
ASKED = (SharedParameter.DELAY, *MOUNT, SharedParameter.HEIGHT)
"""Not the heading, which is part of the mount as it is told."""


class PriorInflation(msgspec.Struct, frozen=True, gc=False):
    """One prior that is wider than it was configured to be."""

    unknown: int
    mean: float
    sigma: float
    """As configured."""
    alone: float
    """What the flight says without it."""

    @property
    def wider_sigma(self) -> float:
        """So wide that the flight is believed."""
        return hypot(self.sigma, self.alone - self.mean)

    def of(self, joint: JointFilter) -> JointFilter:
        """The joint estimate as it would be with the wider prior.

        Information that a prior brought is taken away again (Sherman and Morrison), but for the vehicle's position,
        which is only considered.
        """
        less = self.sigma**-2 - self.wider_sigma**-2
        column = joint.cov[self.unknown]
        factor = less / (1.0 - less * column[self.unknown])
        moved = factor * (joint.mean[self.unknown] - self.mean)
        mean = [m + c * moved for m, c in zip(joint.mean, column, strict=True)]
        cov = [
            [p + factor * a * b for p, b in zip(row, column, strict=True)]
            for row, a in zip(joint.cov, column, strict=True)
        ]
        for i in CONSIDERED:
            mean[i] = joint.mean[i]
            for j in CONSIDERED:
                cov[i][j] = joint.cov[i][j]
        return msgspec.structs.replace(joint, mean=tuple(mean), cov=tuple(map(tuple, cov)))


def prior_inflations(joint: JointFilter, means: Sequence[float], sigmas: Sequence[float]) -> tuple[PriorInflation, ...]:
    """The priors that this flight denies, in the order in which they are to be widened."""
    found: list[PriorInflation] = []
    left = [i for i in ASKED if sigmas[i] > 0.0]
    while left:
        denial, unknown = max((_denial(joint, i, means[i], sigmas[i]), i) for i in left)
        if denial <= DENIED:
            break
        loosening = _loosening(joint, unknown, means[unknown], sigmas[unknown])
        found.append(loosening)
        left.remove(unknown)
        joint = loosening.of(joint)
    return tuple(found)


def _denial(joint: JointFilter, unknown: int, mean: float, sigma: float) -> float:
    """In sigma, at least: the joint estimate only considers the vehicle's position error, so how what it found goes
    with the truth is not known, and the two may differ by the sum of their sigmas. None where nothing was learned.
    """
    found = sqrt(max(0.0, joint.cov[unknown][unknown]))
    return abs(joint.mean[unknown] - mean) / (sigma + found) if found < sigma else 0.0


def _loosening(joint: JointFilter, unknown: int, mean: float, sigma: float) -> PriorInflation:
    moved, found2 = joint.mean[unknown] - mean, joint.cov[unknown][unknown]
    return PriorInflation(unknown, mean, sigma, mean + moved * sigma * sigma / (sigma * sigma - found2))
