"""The smoothed path of a vehicle on steady circles: its own noise, and the velocities that derivatives take."""

import numpy as np
import pytest

from fwav_companion.estimation.vehicle_path import VehiclePath

RADIUS_M, TURN_RAD_S, SECONDS = 3.0, 0.667, 40.0
POSITION_NOISE_M, VELOCITY_NOISE_M_S = 0.1, 0.05


def circles(t):
    """True position and velocity (3, N)."""
    angle = TURN_RAD_S * t
    position = RADIUS_M * np.array([np.sin(angle), -np.cos(angle), 0.0 * t])
    return position, RADIUS_M * TURN_RAD_S * np.array([np.cos(angle), np.sin(angle), 0.0 * t])


def flown(rate_hz, seed):
    """Path by noisy samples of positions and velocities, which come a little unevenly, and the samples' times."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, SECONDS, 1.0 / rate_hz) + rng.uniform(0.0, 0.01, int(SECONDS * rate_hz))
    position, velocity = circles(t)
    position += POSITION_NOISE_M * rng.standard_normal(position.shape)
    velocity += VELOCITY_NOISE_M_S * rng.standard_normal(velocity.shape)
    path = VehiclePath(POSITION_NOISE_M, POSITION_NOISE_M)
    for one in zip(t.tolist(), position.T, velocity.T, strict=True):
        path.append(*one)
    path.settle()
    return path.samples, t[(t > 4.0) & (t < SECONDS - 4.0)]


@pytest.mark.parametrize(("rate_hz", "most_m_s"), [(3, 0.035), (10, 0.02)])
def test_velocities_for_derivatives_are_those_of_the_motion_at_any_rate(rate_hz, most_m_s):
    """Noise in them counts as information on the delays. By displacements over a second it is 0.041 and 0.030 m/s."""
    path, t = flown(rate_hz, seed=1)
    off = path.at(t)[2][:2] - circles(t)[1][:2]
    assert np.sqrt(np.mean(off**2)) < most_m_s


@pytest.mark.parametrize("rate_hz", [3, 10])
def test_noise_of_the_smoothed_path_is_what_it_claims_at_any_rate(rate_hz):
    """A velocity that comes a third of a second before the next one is wrong for all of it."""
    squares = []
    for seed in range(8):
        path, t = flown(rate_hz, seed)
        squares.append(np.mean((path.at(t)[0][:2] - circles(t)[0][:2]) ** 2))
    assert np.sqrt(np.mean(squares)) == pytest.approx(path.noise.level[0], rel=0.25)


def test_position_whose_samples_are_late_goes_on_by_its_velocity_and_says_how_well_it_is_known():
    """A circle leaves its tangent: by 0.6 m in a second."""
    path, _ = flown(10, seed=1)
    t = path.newest + np.array([0.05, 0.5, 1.0])
    off = np.hypot(*(path.at(t)[0] - circles(t)[0])[:2])
    sigma_m = path.unmeasured_m(t)
    assert off[0] < 0.1
    assert sigma_m[0] == 0.0, "within a gap between samples"
    assert (off < 0.1 + sigma_m).all()
    assert off[2] < 0.8
