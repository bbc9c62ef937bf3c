"""Targets at an instant, by the live filter: their places, from the origin and from the vehicle."""

from __future__ import annotations

import numpy as np

from fwav_companion.estimation.answers import TargetAnswer
from fwav_companion.estimation.errors import HEIGHT, POSITION_DELAY, Array
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.live_filter import LiveFilter

_AXES = np.arange(3)
_STILL = np.zeros(2), np.zeros((2, 2))  # velocity of a static target, and its covariance


def target_answers(live: LiveFilter, t: float) -> dict[int, TargetAnswer]:
    """All targets at the instant t: together they cost little more than one."""
    motion = live.poses.motion(t)
    rows, added = _vehicle_rows(live, t, motion.velocity)
    (level, _), (up, _) = live.carrier.path.noise
    jump, stepped = live.steps(t)
    vehicle = motion.at(t) - rows @ live.mean - jump
    rows[2, HEIGHT] = 1.0
    vehicle[2] -= live.mean[HEIGHT]
    common = rows @ live.covariance @ rows.T
    common[_AXES, _AXES] += added + stepped + np.array([level * level, level * level, up * up])
    answers = {}
    for numbers, mean, covariance, cross in live.places():
        place, own, by_base = _places_at(live, t, mean, covariance, cross)
        seen = by_base @ rows.T  # (T, 3, 3)
        relative = own + seen + seen.swapaxes(1, 2) + common
        moves = mean.shape[1] > TARGET_SIZE
        for i, k in enumerate(numbers):
            velocity = (mean[i, TARGET_SIZE:], covariance[i, TARGET_SIZE:, TARGET_SIZE:]) if moves else _STILL
            answers[k] = TargetAnswer(place[i], own[i], place[i] - vehicle, relative[i], *velocity)
    return answers


def _vehicle_rows(live: LiveFilter, t: float, velocity: Array) -> tuple[Array, Array]:
    """Rows (3, n): apparent minus true vehicle (north, east, up) by the base state; variance (3,) added by then."""
    keep, added = live.ageing(t)
    rows = np.zeros((TARGET_SIZE, len(live.mean)))
    rows[_AXES, live.errors] = keep
    rows[:, POSITION_DELAY] = -velocity
    return rows, added


def _places_at(live: LiveFilter, t: float, mean: Array, covariance: Array, cross: Array) -> tuple[Array, Array, Array]:
    """Places (T, 3) north, east, height at t, covariances (T, 3, 3), and with the base state (T, 3, n).

    mean: (T, k) states of three or five; covariance: (T, k, k); cross: (T, k, n).
    """
    ground, slope = live.model.ground.height(mean[:, :2].T)
    place, count = mean[:, :TARGET_SIZE].copy(), mean.shape[1]
    place[:, 2] += ground
    if t == live.t and not slope.any():
        return place, covariance[:, :TARGET_SIZE, :TARGET_SIZE], cross[:, :TARGET_SIZE]
    lift = np.zeros((len(mean), TARGET_SIZE, count))  # places at t by the states
    lift[:, _AXES, _AXES] = 1.0
    lift[:, 2, :2] = slope.T
    if count > TARGET_SIZE:
        place[:, :2] += (t - live.t) * mean[:, TARGET_SIZE:]
        lift[:, 0, 3] = lift[:, 1, 4] = t - live.t
    return place, lift @ covariance @ lift.swapaxes(1, 2), lift @ cross
