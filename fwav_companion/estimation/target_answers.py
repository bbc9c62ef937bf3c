"""Targets at an instant, by the live filter: their places, from the origin and from the vehicle."""

from __future__ import annotations

import numpy as np

from fwav_companion.estimation.answers import TargetAnswer
from fwav_companion.estimation.errors import HEIGHT, Array
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.live_filter import LiveFilter
from fwav_companion.estimation.path_samples import PathSamples


def target_answers(live: LiveFilter, t: float) -> dict[int, TargetAnswer]:
    """All targets at the instant t: together they cost little more than one."""
    position, velocity = reported_motion(live.carrier.path, t)
    rows, added = live.vehicle_rows(t, velocity)
    (level, _), (up, _) = live.carrier.path.noise
    vehicle = position - rows @ live.mean
    rows[2, HEIGHT] = 1.0
    vehicle[2] -= live.mean[HEIGHT]
    common = rows @ live.covariance @ rows.T + np.diag(added + np.array([level, level, up]) ** 2)
    mean, covariance, cross = live.places()  # (T, 5), (T, 5, 5), (T, 5, n)
    ground, slope = live.model.ground.height(mean[:, :2].T)
    lift = np.zeros((len(mean), TARGET_SIZE, mean.shape[1]))  # places at t by the states
    lift[:, :, :TARGET_SIZE] = np.eye(TARGET_SIZE)
    lift[:, 2, :2] = slope.T
    lift[:, 0, 3] = lift[:, 1, 4] = t - live.t
    place = (lift @ mean[..., None])[..., 0]
    place[:, 2] = mean[:, 2] + ground
    own, seen = lift @ covariance @ lift.swapaxes(1, 2), lift @ (cross @ rows.T)  # (T, 3, 3) each
    relative = own + seen + seen.swapaxes(1, 2) + common
    return {
        k: TargetAnswer(place[i], own[i], place[i] - vehicle, relative[i], mean[i, 3:], covariance[i, 3:, 3:])
        for i, k in enumerate(live.targets.tolist())
    }


def reported_motion(path: PathSamples, t: float) -> tuple[Array, Array]:
    """Reported position (3,) and velocity (3,) at t, carried on by the velocity beyond the newest sample."""
    last = min(t, path.newest)
    position, velocity, _ = path.at(np.array([last]))
    return position[:, 0] + velocity[:, 0] * (t - last), velocity[:, 0]
