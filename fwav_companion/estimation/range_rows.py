"""Rows of rangefinder readings in the normal equations of a solve."""

from __future__ import annotations

import numpy as np

from fwav_companion.estimation.errors import POSITION_DELAY
from fwav_companion.estimation.information import SightingInformation
from fwav_companion.estimation.problem import Problem, State
from fwav_companion.estimation.wander import WanderKernel

_WIDE_DISTANCE2 = 16.0  # squared distance at which a reading counts by half: trees, and the edge of a roof


def with_readings(
    problem: Problem, state: State, kernel: WanderKernel, sightings: SightingInformation
) -> SightingInformation:
    """The sightings' information with that of the readings between the knots.

    Weights are Cauchy's: a reading that departs from the others is of a tree, not of the ground.
    """
    used = problem.readings
    if used is None or not len(used.t):
        return sightings
    knots, n = problem.knots, len(used.t)
    left = (knots.searchsorted(used.t, side="right") - 1).clip(0, len(knots) - 2)
    gap = problem.gaps[left]
    part = ((used.t - knots[left]) / gap).clip(0.0, 1.0)
    position, velocity, calm = problem.carrier.path.at(used.t)  # (3, N) each
    up = state.errors[:, 2]
    ground, _ = problem.model.ground.height(used.foot)
    delay = float(state.shared[POSITION_DELAY])
    predicted = position[2] + velocity[2] * delay - up[left] * (1.0 - part) - up[left + 1] * part - ground
    residual = used.height_m - predicted

    rows = np.zeros((problem.size, n))
    rows[POSITION_DELAY] = calm[2]
    of_reading, at = np.arange(n), problem.errors_at + 3 * left + 2
    rows[at, of_reading], rows[at + 3, of_reading] = -(1.0 - part), -part

    _, wander = problem.wanders(kernel)
    variance = used.variance + wander.bridge(gap, part)
    weight = 1.0 / (1.0 + residual * residual / (variance * _WIDE_DISTANCE2))
    divided = rows * (weight / variance)
    return SightingInformation(
        sightings.information + divided @ rows.T,
        sightings.right + divided @ residual,
        sightings.squares + float((weight / variance * residual * residual).sum()),
        sightings.log_determinant + float(np.log(variance / weight).sum()),
    )
