"""Search for the mount with the least spread of a static target's sights, by rotation steps about the body axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, radians

import numpy as np

from fwav_companion.self_calibration.arrays import Array, rotation, times
from fwav_companion.self_calibration.sights import CommonPoint, Sights

STEPS = tuple(map(radians, (40.0, 20.0, 10.0, 5.0, 2.0)))
"""Rotation steps of the search among all mounts, rad: the first is about half the angle to the next start."""
SMALL_STEPS = tuple(map(radians, (4.0, 2.0, 1.0)))
"""Rotation steps of a search near one mount, rad."""
STARTS: Array = np.array(
    [(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (0, 0, 2)]
) * radians(90.0)  # fmt: skip
"""Rotations of the configured mount at which the search starts: rotation vectors, body axes, rad."""
AXES: Array = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], float)


def searched(
    seen: Sights, starts: Array, steps: Sequence[float], allowed: Callable[[Array], bool] = lambda _: True
) -> CommonPoint:
    """The ``allowed`` mount with the least spread: from the best start by steps about the body axes."""
    best = min(seen.meeting(starts), key=_spread)
    for step in steps:
        least = inf
        while best.spread < least:
            least = best.spread
            near = times(rotation(AXES * step), best.body_from_camera)
            near = near[[allowed(each) for each in near]]
            best = min([best, *(seen.meeting(near) if len(near) else ())], key=_spread)
    return best


def _spread(common: CommonPoint) -> float:
    return common.spread
