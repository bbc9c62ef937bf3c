"""The mount that gathers the sights of a static target best: a search by steps about the axes of the body."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, radians

import numpy as np

from fwav_companion.self_calibration.arrays import Array, rotation, times
from fwav_companion.self_calibration.sights import CommonPoint, Sights

STEPS = tuple(map(radians, (40.0, 20.0, 10.0, 5.0, 2.0)))
"""Steps of the search among mounts: the first reaches half way to the next start."""
SMALL_STEPS = tuple(map(radians, (4.0, 2.0, 1.0)))
STARTS: Array = np.array(
    [(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (0, 0, 2)]
) * radians(90.0)  # fmt: skip
"""Rotation vectors, body axes."""
AXES: Array = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], float)


def searched(
    seen: Sights, starts: Array, steps: Sequence[float], allowed: Callable[[Array], bool] = lambda _: True
) -> CommonPoint:
    """The ``allowed`` mount that gathers the sights best: from the best start by steps about body axes."""
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
