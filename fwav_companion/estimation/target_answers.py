"""Targets at an instant, by the live filter: their places, from the origin and from the vehicle."""

from __future__ import annotations

from typing import Final

import numpy as np

from fwav_companion.estimation.answers import TargetAnswer
from fwav_companion.estimation.errors import HEIGHT, Array
from fwav_companion.estimation.live_filter import LiveFilter
from fwav_companion.estimation.moving import MovingTarget

_AT_REST: Final = np.zeros(2)
_NO_SPREAD: Final = np.zeros((2, 2))


def static_answers(live: LiveFilter, t: float) -> dict[int, TargetAnswer]:
    """All static targets at the instant t: together they cost little more than one."""
    position, velocity = _vehicle(live, t)
    rows, added = live.vehicle_rows(t, velocity)
    (level, _), (up, _) = live.carrier.path.noise
    vehicle = position - rows @ live.mean
    rows[2, HEIGHT] = 1.0
    vehicle[2] -= live.mean[HEIGHT]
    common = rows @ live.covariance @ rows.T + np.diag(added + np.array([level, level, up]) ** 2)
    place, covariance, cross = live.places()
    ground, slope = live.model.ground.height(place[:, :2].T)
    place[:, 2] += ground
    own, seen = covariance, cross @ rows.T  # (T, 3, 3) each
    if slope.any():
        lift = np.tile(np.eye(3), (len(place), 1, 1))
        lift[:, 2, :2] = slope.T
        own, seen = lift @ own @ lift.swapaxes(1, 2), lift @ seen
    relative = own + seen + seen.swapaxes(1, 2) + common
    return {
        k: TargetAnswer(place[i], own[i], place[i] - vehicle, relative[i], _AT_REST, _NO_SPREAD)
        for i, k in enumerate(live.targets.tolist())
    }


def moving_answer(live: LiveFilter, moving: MovingTarget, t: float) -> TargetAnswer:
    """A moving target at the instant t."""
    position, velocity = _vehicle(live, t)
    level, level_covariance = moving.relative(live, t, position[:2], velocity[:2])
    e = live.error
    place = level + position[:2] + velocity[:2] * live.mean[8] - live.mean[e : e + 2]
    ground = float(live.model.ground.height(place[:, None])[0][0])
    covariance, relative = np.zeros((3, 3)), np.zeros((3, 3))
    covariance[:2, :2] = level_covariance + live.covariance[e : e + 2, e : e + 2]
    relative[:2, :2] = level_covariance
    height = np.zeros(len(live.mean))
    height[[HEIGHT, e + 2]] = 1.0
    relative[2, 2] = float(height @ live.covariance @ height) + live.carrier.path.noise.up[0] ** 2
    up = ground - float(position[2] - height @ live.mean)
    return TargetAnswer(
        np.append(place, ground), covariance, np.append(level, up), relative, moving.state[2:].copy(),
        moving.own[2:, 2:].copy(),
    )  # fmt: skip


def _vehicle(live: LiveFilter, t: float) -> tuple[Array, Array]:
    """Reported position (3,) and velocity (3,) at t, carried on by the velocity beyond the newest sample."""
    last = min(t, live.carrier.path.newest)
    position, velocity, _ = live.carrier.path.at(np.array([last]))
    return position[:, 0] + velocity[:, 0] * (t - last), velocity[:, 0]
