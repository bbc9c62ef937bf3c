"""The smoothed path at its ends: what its first samples claim, and how it goes on beyond its newest one."""

import numpy as np
import pytest

from fwav_companion.estimation.vehicle_path import VehiclePath

NOISE_M, HEIGHT_NOISE_M, VELOCITY_NOISE_M_S, STEP_S = 0.1, 0.3, 0.05, 0.1
DRAWS = 200
VELOCITY = np.array([4.0, -3.0, 0.5])


def paths_of(samples):
    """Reported straight flights of this many samples, each with its own noise."""
    rng = np.random.default_rng(samples)
    for _ in range(DRAWS):
        path = VehiclePath(NOISE_M, HEIGHT_NOISE_M)
        for k in range(samples):
            t = k * STEP_S
            noise = rng.normal(size=3) * (NOISE_M, NOISE_M, HEIGHT_NOISE_M)
            path.append(t, VELOCITY * t + noise, VELOCITY + rng.normal(0.0, VELOCITY_NOISE_M_S, 3))
        yield path.samples


@pytest.mark.parametrize("samples", [1, 2, 4, 8])
def test_first_samples_of_a_path_claim_the_noise_that_they_have(samples):
    t = (samples - 1) * STEP_S
    errors, claims = [], []
    for path in paths_of(samples):
        errors.append(path.at(np.array([t]))[0][:, 0] - VELOCITY * t)
        (level_m, _), (up_m, _) = path.noise
        level2, up2 = path.unsettled(t)
        claims.append((level_m**2 + level2, level_m**2 + level2, up_m**2 + up2))
    squares = np.mean(np.square(errors) / claims, axis=0)
    assert (squares > 0.7).all()
    assert (squares < 1.4).all()


@pytest.mark.parametrize("beat_hz", [3.7, 5.0])
def test_path_of_a_vehicle_that_heaves_goes_on_by_its_velocity(beat_hz):
    """By 2 cm with each beat: a velocity carries it on for a part of the beat, the bend of a cubic does not."""
    phases, errors = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False), []
    for phase in phases:
        path, w = VehiclePath(0.01, 0.01), 2.0 * np.pi * beat_hz
        for k in range(20):
            turn = w * k * STEP_S + phase
            heave_m, climb_m_s = 0.02 * np.sin(turn), 0.02 * w * np.cos(turn)
            path.append(k * STEP_S, np.array([0.0, 0.0, heave_m]), np.array([0.0, 0.0, climb_m_s]))
        at = 1.9 + 0.07
        errors.append(path.samples.at(np.array([at]))[0][2, 0] - 0.02 * np.sin(w * at + phase))
    assert np.sqrt(np.mean(np.square(errors))) < 0.03


def test_path_of_a_vehicle_that_turns_goes_on_in_its_turn():
    """A circle of 8 m at 5 m/s: its tangent is left by 1.6 cm within a tenth of a second."""
    path, w, times = VehiclePath(0.01, 0.01), 5.0 / 8.0, np.arange(20) * STEP_S
    circle = np.array([8.0 * np.cos(w * times), 8.0 * np.sin(w * times), 10.0 + 0.0 * times]).T
    velocity = np.array([-5.0 * np.sin(w * times), 5.0 * np.cos(w * times), 0.0 * times]).T
    for t, place, rates in zip(times, circle, velocity, strict=True):
        path.append(t, place, rates)
    at = np.array([times[-1], times[-1] + STEP_S])
    off = path.samples.at(at)[0][:2] - np.array([8.0 * np.cos(w * at), 8.0 * np.sin(w * at)])
    assert np.hypot(*(off[:, 1] - off[:, 0])) < 0.004


def reported(position_noise_m, wander_m, velocity_error_m_s, seed, seconds=40):
    """Path of a vehicle at rest at the origin by 10 Hz: white noise, a random walk of the position (m within a second),
    and an error of the velocities that turns about in 20 s; its newest positions (2, 100).
    """
    rng, path = np.random.default_rng(seed), VehiclePath(NOISE_M, NOISE_M)
    walk = np.zeros(3)
    for k in range(round(seconds / STEP_S)):
        t, walk = k * STEP_S, walk + wander_m * np.sqrt(STEP_S) * rng.standard_normal(3) * (1.0, 1.0, 0.0)
        turn = 2.0 * np.pi * t / 20.0
        wrong = velocity_error_m_s * np.array([np.cos(turn), np.sin(turn), 0.0])
        path.append(t, walk + position_noise_m * rng.standard_normal(3), wrong)
    path.settle()
    return path.samples


@pytest.mark.parametrize("seed", [1, 2])
def test_velocities_that_are_wrong_for_seconds_move_no_path_away_from_its_positions(seed):
    """As PX4's in its simulator, by 0.3 m/s: a filter that trusts them lags by 0.6 m."""
    path = reported(0.02, 0.0, 0.3, seed)
    off = path.at(path.newest - np.linspace(0.0, 10.0, 50))[0][:2]
    assert np.hypot(*off).max() < 0.15


@pytest.mark.parametrize("seed", range(1, 6))
def test_receiver_that_wanders_leaves_the_path_to_its_velocities(seed):
    """By 0.18 m within a second, a random walk: sightings find it, and the velocities are right."""
    path = reported(0.1, 0.18, 0.0, seed)
    assert path.noise.level[0] < 0.02
