"""Priors that a flight contradicts: they are widened to the flight's estimate, so that they do not bias other
parameters.

The height above a home that was set metres off, or a mount that was moved, is wrong by many sigma of [uncertainty]. If
a wrong prior held such a parameter, its error would appear in another one: a height error as a mount error of degrees,
which displaces every target.
"""

from __future__ import annotations

from math import sqrt

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibration_report import PriorInflation, SharedParameter
from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.self_calibration.posterior import MOUNT_AXES

DENIED = 4.0
"""Distance between configuration and estimate, in sigma, beyond which one of the two is wrong."""
TESTED = (SharedParameter.DELAY, *MOUNT_AXES, SharedParameter.HEIGHT)
"""Parameters whose priors are tested; not the heading, because the reported mount includes it."""


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


def is_plausible(joint: JointFilter, means: Array, sigmas: Array) -> bool:
    """Whether the parameters without a test of their prior agree with it: no prior of theirs is widened.

    A heading 20 degrees off, positions 0.4 s old or a camera half a metre aside of its place are no error of the
    vehicle: the estimate has diverged. ``sigmas``: of the priors, the widened ones among them.
    """
    others = [i for i in range(SHARED_COUNT) if i not in TESTED and sigmas[i] > 0.0]
    return all(_denial(joint, i, float(means[i]), float(sigmas[i])) <= DENIED for i in others)


def _denial(joint: JointFilter, i: int, mean: float, sigma: float) -> float:
    """Distance of a parameter's estimate from its prior mean in sigma, a lower bound; 0 where the sigma did not shrink.

    The joint estimate only considers the vehicle's position error, so the correlation of its errors is not known, and
    estimate and prior mean may differ by the sum of their sigmas.
    """
    found = sqrt(max(0.0, joint.cov[0, i, i]))
    return float(abs(joint.mean[0, i] - mean)) / (sigma + found) if found < sigma else 0.0
