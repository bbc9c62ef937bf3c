"""The linearization point: smoothed height, running mean of the innovations, and sensitivities over level ground."""

import numpy as np
import pytest
from handmade import a_fix
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

from fwav_companion.tracking.filters.linearization import (
    CLIMB_DENSITY,
    SENSITIVE,
    first_point,
    is_level,
    level_columns,
)
from fwav_companion.types import Bias

PLACE = (4.0, 3.0, 0.0)


def seen_from(height_m):
    fix = a_fix(0.0, PLACE)
    return replace(fix, sighting=replace(fix.sighting, camera_ned=(0.0, 0.0, -height_m)))


def test_a_climbing_height_is_smoothed_as_by_a_kalman_filter_in_numpy():
    rng, sigma = np.random.default_rng(2), 0.3
    point, mean, cov = first_point(seen_from(15.0), sigma), np.array([15.0, 0.0]), np.diag([sigma**2, 1.0])
    for dt in rng.uniform(0.1, 0.4, 200):
        height = 15.0 + rng.normal(0.0, sigma)
        point = point.with_fix(height, 0.0, 0.0, interval_s=dt, sigma_m=sigma)
        move = np.array([[1.0, dt], [0.0, 1.0]])
        more = CLIMB_DENSITY * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        mean, cov = move @ mean, move @ cov @ move.T + more
        gain = cov[:, 0] / (cov[0, 0] + sigma**2)
        mean, cov = mean + gain * (height - mean[0]), cov - np.outer(gain, cov[0])
        assert (point.height_m, point.climb_m_s) == pytest.approx(tuple(mean), abs=1e-9)
    assert np.sqrt(point.height_cov[0]) < 0.6 * sigma


def test_the_running_mean_follows_a_shift_within_two_seconds_and_forgets_noise():
    rng, point = np.random.default_rng(3), first_point(seen_from(10.0), 0.1)
    offs = []
    for k in range(600):
        shift = 0.0 if k < 300 else 1.0
        north = PLACE[0] + shift + rng.normal(0.0, 0.2)
        point = point.with_fix(10.0, north, PLACE[1], interval_s=1 / 30, sigma_m=0.1)
        offs.append(point.north_m - PLACE[0] - shift)
    assert np.std(offs[60:300]) < 0.2 / 3
    assert abs(offs[360]) < 0.2


@pytest.mark.parametrize("seed", range(4))
def test_columns_of_level_ground_are_the_derivatives_of_where_the_ray_meets_it(seed):
    """Turned by the same small angles about the carrier's axes, ray and all; the mount counts the other way."""
    rng = np.random.default_rng(seed)
    ned_from_body = Rotation.from_euler("ZYX", rng.uniform([-180, -20, -20], [180, 20, 20]), degrees=True)
    sight = np.array([*rng.uniform(-6.0, 6.0, 2), 10.0])

    def met(turned, sight, height_m):
        ray = (ned_from_body * turned * ned_from_body.inv()).apply(sight)
        return ray[:2] * height_m / ray[2]

    fix = a_fix(0.0, PLACE)
    x, y, z, w = ned_from_body.as_quat()
    fix = replace(fix, sighting=replace(fix.sighting, state=replace(fix.sighting.state, ned_from_body=(w, x, y, z))))
    columns, step = dict(zip(SENSITIVE, level_columns(fix, *sight), strict=True)), 1e-6
    for axis, attitude, mount in ((0, Bias.ROLL, Bias.MOUNT_X), (1, Bias.PITCH, Bias.MOUNT_Y), (2, None, Bias.MOUNT_Z)):
        turns = [Rotation.from_rotvec(sign * step * np.eye(3)[axis]) for sign in (1.0, -1.0)]
        derivative = (met(turns[0], sight, 10.0) - met(turns[1], sight, 10.0)) / (2.0 * step)
        assert columns[mount] == pytest.approx(-derivative, abs=1e-6)
        if attitude is not None:
            assert columns[attitude] == pytest.approx(derivative, abs=1e-6)
    higher = met(Rotation.identity(), sight, 10.0 + step) - met(Rotation.identity(), sight, 10.0 - step)
    assert columns[Bias.HEIGHT] == pytest.approx(higher / (2.0 * step))


@pytest.mark.parametrize(
    ("ground", "relative", "level"), [("home", False, True), ("home", True, False), ("dem", False, False)]
)
def test_only_the_home_surface_with_a_height_above_it_is_known_to_be_level(ground, relative, level):
    fix = a_fix(0.0, PLACE)
    fix = replace(fix, ground=ground, sighting=replace(fix.sighting, relative=relative))
    assert is_level(fix) is level
