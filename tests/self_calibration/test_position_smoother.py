"""Smoothed positions: their noise, their path between reports, and steps of the position."""

from itertools import pairwise

import msgspec
import numpy as np
import pytest
from path_batches import along
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.measurement_batch import joined, measurement_batch
from fwav_companion.self_calibration.position_path import VELOCITY_DENSITY, PositionPath, chord_error_m
from fwav_companion.self_calibration.vehicle_motion import VehicleMotion, in_motion, moved, smoothed_back

PRIORS = priors(position_noise_m=0.1, height_noise_m=0.3)
TURN = 0.7
"""Angular frequency of a circle of 3 m, rad/s."""
TIGHT = 2.9
"""The same of the tightest circle that is flown, rad/s."""


@pytest.fixture(scope="module")
def batch():
    world = World(Flight(seconds=2, shape="hover", height_m=10.0, targets=((4.0, 3.0),)))
    fix = next(fix for view in world.frames() for fix in view.fixes)
    return measurement_batch([(1, fix)], delayed_poses([fix.sighting.state], (0.0,), world.state_at), (0.0,))


def true_path(t, turn=TURN):
    radius = 2.1 / turn
    position = np.array([radius * np.cos(turn * t), radius * np.sin(turn * t), -10.0])
    return position, turn * np.array([-position[1], position[0], 0.0])


def batch_at(batch, at_s, position, velocity):
    poses = msgspec.structs.replace(
        batch.poses, delay_s=np.zeros((1, 1)), position_ned=position[None, None], velocity_ned=velocity[None, None]
    )
    return msgspec.structs.replace(batch, poses=poses)


def smoothed(batch, count=300, noise=(0.1, 0.1, 0.3), step_m=0.0, delays=(0.0,), seed=1, turn=TURN, missed=()):
    """(true, smoothed) positions of batches ten times a second; a step of the position to the north half way.

    ``missed``: batches of every twenty that do not come.
    """
    rng, state, found = np.random.default_rng(seed), PositionPath(), []
    for k in range(count):
        if k % 20 in missed:
            continue
        at = 0.1 * k - np.array(delays)
        path = np.array([true_path(t, turn)[0] for t in at])
        reported = path + np.array(noise) * rng.standard_normal(3) + (step_m * (2 * k > count), 0.0, 0.0)
        poses = msgspec.structs.replace(
            batch.poses,
            delay_s=np.array([delays]),
            position_ned=reported[None],
            velocity_ned=np.array([[true_path(t, turn)[1] for t in at]]),
        )
        state, after = along(state, msgspec.structs.replace(batch, poses=poses), 0.1 * k, PRIORS)
        found.append((path, after.poses.position_ned[0]))
    true, path = map(np.array, zip(*found, strict=True))
    return true, path


def test_positions_and_heights_lose_most_of_their_noise(batch):
    """The steady Kalman filter of a random walk: the variance is the root of both densities."""
    true, path = smoothed(batch, 3000)
    off = (path - true)[100:, 0]
    density = 0.1**2 * 0.1
    expected = [(density * 0.1 * sigma**2) ** 0.25 for sigma in (0.1, 0.1, 0.3)]
    assert np.all(off.std(0) < 1.15 * np.array(expected))
    assert np.abs(off.mean(0)).max() < 0.01


def test_all_delays_lie_on_one_path(batch):
    """States around one capture are interpolated between other reports, each with noise of its own."""
    true, path = smoothed(batch, 200, delays=(-0.06, 0.0, 0.06))
    off = (path - true)[50:]
    assert np.abs(off[:, 0] - off[:, 1]).max() < 0.005
    assert np.abs(off[:, 2] - off[:, 1]).max() < 0.005


def test_a_step_of_the_position_is_followed_at_once(batch):
    true, path = smoothed(batch, 200, step_m=3.0)
    assert np.abs((path - true)[101:, 0, 0] - 3.0).max() < 0.5


def test_a_path_between_sights_that_turned_meanwhile_does_not_cut_the_corner(batch):
    """0.7 s of every two are missed on a circle of 2.2 s; the chord of those is 0.3 m short of the arc."""
    true, path = smoothed(batch, 3000, turn=TIGHT, missed=range(7))
    off = np.hypot(*(path - true)[50:, 0, :2].T)
    assert np.sqrt(np.mean(off**2)) < 0.12


def test_a_path_smoothed_by_later_positions_is_the_least_squares_path(batch):
    """All reports at once: positions against their noise, steps against what the velocities leave open."""
    rng, state, times = np.random.default_rng(4), PositionPath(), np.arange(12) * 0.1
    true = [true_path(t) for t in times]
    noise = np.array((0.1, 0.1, 0.3))
    reported = [position + noise * rng.standard_normal(3) for position, _ in true]
    kept = []
    for t, position, (_, velocity) in zip(times, reported, true, strict=True):
        state, after = along(state, batch_at(batch, t, position, velocity), t, PRIORS)
        kept.append(after)
    found = np.array([b.poses.position_ned[0, 0] for b in kept]) + np.concatenate(smoothed_back(kept))

    velocities = np.array([velocity for _, velocity in true])
    steps = 0.05 * (velocities[1:] + velocities[:-1])
    sigma = np.sqrt(
        [VELOCITY_DENSITY * 0.1 + chord_error_m(tuple(a), tuple(b), 0.1) ** 2 for a, b in pairwise(velocities)]
    )
    for axis in range(3):
        rows = np.vstack((np.eye(12) / noise[axis], np.diff(np.eye(12), axis=0) / sigma[:, None]))
        right = np.concatenate((np.array(reported)[:, axis] / noise[axis], steps[:, axis] / sigma))
        expected = np.linalg.lstsq(rows, right, rcond=None)[0]
        assert found[:, axis] == pytest.approx(expected, abs=1e-9)


def test_positions_before_a_step_are_not_smoothed_by_those_after_it(batch):
    state, kept = PositionPath(), []
    for k in range(10):
        position = np.array((0.0 if k < 5 else 5.0, 0.0, -10.0))
        state, after = along(state, batch_at(batch, 0.1 * k, position, np.zeros(3)), 0.1 * k, PRIORS)
        kept.append(after)
    assert np.concatenate(smoothed_back(kept)) == pytest.approx(np.zeros((10, 3)), abs=1e-12)


def test_a_batch_of_several_points_of_the_path_is_as_its_parts(batch):
    """Each measurement lies on the point of its own, and moves with that."""
    state, parts, motions = PositionPath(), [], []
    for k in range(6):
        state, part = along(state, batch_at(batch, 0.1 * k, *true_path(0.1 * k)), 0.1 * k, PRIORS)
        parts.append(part)
        motions.append(VehicleMotion(path=state))
    unsmoothed = joined([batch_at(batch, 0.1 * k, *true_path(0.1 * k)) for k in range(6)])
    whole = in_motion(unsmoothed, 0.1 * np.arange(6), motions, range(6))
    assert np.array_equal(whole.poses.position_ned, joined(parts).poses.position_ned)
    (shifts,) = smoothed_back([whole])
    assert np.array_equal(shifts, np.concatenate(smoothed_back(parts)))
    assert np.abs(shifts[0]).max() > 0.0
    apart = [moved(part, shift[None]) for part, shift in zip(parts, shifts, strict=True)]
    assert np.array_equal(moved(whole, shifts).poses.position_ned, joined(apart).poses.position_ned)


def climbing(climb_error_m_s, seed=1, count=600):
    """(path, true down) ten times a second of a level flight whose vertical velocity errs from the tenth second on."""
    rng, path, found = np.random.default_rng(seed), PositionPath(), []
    for k in range(count):
        reported = tuple((np.array((0.0, 0.0, -10.0)) + np.array((0.1, 0.1, 0.3)) * rng.standard_normal(3)).tolist())
        path = path.after(0.1 * k, reported, (0.0, 0.0, climb_error_m_s if k > 100 else 0.0), PRIORS)
        found.append(path)
    return found


@pytest.mark.parametrize("climb_error_m_s", [0.4, -1.2])
def test_a_wrong_climb_moves_the_path_by_decimetres(climb_error_m_s):
    """Without the mean of its innovations the path lags by 1.2 m, or starts again and again."""
    off = [np.array([path.position[2] + 10.0 for path in climbing(climb_error_m_s, seed)][120:]) for seed in range(5)]
    assert np.sqrt(np.mean(np.square(off))) < 0.45


@pytest.mark.parametrize("seed", range(5))
def test_heights_are_hardly_ever_opened_by_noise_alone(seed):
    paths = climbing(0.0, seed)
    assert sum(path.opened_m2 > 0.0 for path in paths) <= 2
    assert np.std([path.position[2] for path in paths[50:]]) < 0.08


def test_later_heights_do_not_move_those_before_a_lag_was_noticed():
    """Smoothed back, the path before the wrong climb stays where it was: the height that was opened says nothing."""
    paths = climbing(-1.2)
    k = next(i for i, path in enumerate(paths) if path.opened_m2 > 0.0 and i > 100)
    shift = paths[k - 1].shift_by(paths[k], (0.0, 0.0, 1.0))
    assert abs(shift[2]) < 0.3
    assert abs(paths[k - 2].shift_by(paths[k - 1], (0.0, 0.0, 1.0))[2]) > 0.5
