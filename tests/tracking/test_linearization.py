"""The linearization point: smoothed height, running mean of the innovations, and sensitivities over level ground."""

import numpy as np
import pytest
from handmade import a_fix, vector
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

from fwav_companion.tracking.filters.linearization import (
    CLIMB_DENSITY,
    SENSITIVE,
    delay_curvature,
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


def swinging(t, frequency=2.0 * np.pi * 14.0, heading=0.6):
    """Attitude of a wing that pitches by 17 and rolls by 3 degrees, and the ground 4 m north and 3 m east at t = 0."""
    angles = np.radians([3.0, 17.0]) * np.sin(frequency * t + np.array([1.0, 1.3]))
    return Rotation.from_euler("ZYX", [heading, angles[1], angles[0]])


def ground_at(t, **swing):
    ray = (swinging(t, **swing) * swinging(0.0, **swing).inv()).apply([4.0, 3.0, 10.0])
    return ray[:2] * 10.0 / ray[2]


def swung(**swing):
    """The fix at t = 0 with the rates and accelerations of the swing, by differences."""
    fix, step = seen_from(10.0), 1e-4

    def rates(t):
        return (swinging(t - step, **swing).inv() * swinging(t + step, **swing)).as_rotvec() / (2.0 * step)

    return turned(
        fix, swinging(0.0, **swing), rates(0.0), (rates(step) - rates(-step)) / (2.0 * step),
        swing.get("frequency", 2.0 * np.pi * 14.0),
    )  # fmt: skip


def turned(fix, attitude, rates, acceleration, frequency):
    x, y, z, w = map(float, attitude.as_quat())
    state = replace(
        fix.sighting.state, ned_from_body=(w, x, y, z), rates=vector(rates), angular_acceleration=vector(acceleration),
        turning_frequency=frequency,
    )  # fmt: skip
    return replace(fix, sighting=replace(fix.sighting, state=state))


def test_the_curvature_of_a_short_delay_is_the_second_derivative_of_the_ground_point():
    step, sigma = 1e-4, 1e-5
    second = (ground_at(step) - 2.0 * ground_at(0.0) + ground_at(-step)) / step**2
    assert np.linalg.norm(second) > 1000.0
    assert delay_curvature(swung(), sigma) == pytest.approx(tuple(second * sigma**2 / np.sqrt(2.0)), rel=1e-3)


@pytest.mark.parametrize("sigma", [0.003, 0.01, 0.03])
def test_at_the_end_of_a_swing_it_is_the_scatter_over_the_delays_of_the_prior(sigma):
    """A small pitch straight above the target, by quadrature over the delays; a parabola would be 5 times too wide."""
    frequency, amplitude = 2.0 * np.pi * 14.0, 0.02
    acceleration = (0.0, -amplitude * frequency**2, 0.0)
    attitude = Rotation.from_euler("y", amplitude)
    above = replace(seen_from(10.0), position_ned=(0.0, 0.0, 0.0))
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    moved = 10.0 * amplitude * np.cos(frequency * sigma * nodes)
    weights /= weights.sum()
    expected = np.sqrt(weights @ (moved - weights @ moved) ** 2)
    north, east = delay_curvature(turned(above, attitude, (0, 0, 0), acceleration, frequency), sigma)
    assert (abs(north), east) == pytest.approx((expected, 0.0), rel=1e-6, abs=1e-9)


def test_a_vehicle_that_does_not_turn_has_no_curvature():
    assert delay_curvature(seen_from(10.0), 0.05) == (0.0, 0.0)
