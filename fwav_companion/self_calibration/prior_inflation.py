"""Priors that a flight contradicts: widened to the flight's estimate, instead of bending everything else.

A height above a home that was set metres off, or a mount that was moved, lies many sigma outside of [uncertainty]. A
parameter held there, or pulled there, would appear as another one: a height as a mount off by degrees, and every target
with it.
"""

from __future__ import annotations

from math import sqrt

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_report import PriorInflation, SharedParameter
from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.posterior import MOUNT_AXES

DENIED = 4.0
"""Sigma between configuration and estimate, at which one of the two is wrong."""
TESTED = (SharedParameter.DELAY, *MOUNT_AXES, SharedParameter.HEIGHT)
"""Not the heading, which is part of the mount as it is reported."""


def prior_inflations(joint: JointFilter, means: Array, sigmas: Array) -> tuple[PriorInflation, ...]:
    """The priors that this flight contradicts, in the order in which they are to be widened."""
    found: list[PriorInflation] = []
    left = [i for i in TESTED if sigmas[i] > 0.0]
    while left:
        denial, i = max((_denial(joint, i, float(means[i]), float(sigmas[i])), i) for i in left)
        if denial <= DENIED:
            break
        mean, sigma = float(means[i]), float(sigmas[i])
        alone = mean + float(joint.mean[0, i] - mean) * sigma * sigma / (sigma * sigma - float(joint.cov[0, i, i]))
        found.append(PriorInflation(int(i), mean, sigma, alone))
        left.remove(i)
        joint = joint.inflated(found[-1])
    return tuple(found)


def _denial(joint: JointFilter, i: int, mean: float, sigma: float) -> float:
    """Sigma of the contradiction, at least; 0 where nothing was learned.

    The joint estimate only considers the vehicle's position error, so the correlation of its errors is not known, and
    the two may differ by the sum of their sigmas.
    """
    found = sqrt(max(0.0, joint.cov[0, i, i]))
    return float(abs(joint.mean[0, i] - mean)) / (sigma + found) if found < sigma else 0.0
