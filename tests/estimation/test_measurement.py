"""The projection and its Jacobian: signs by planted errors, derivatives by numerical differences."""

import numpy as np
import pytest
from estimated_flights import PLANTED, reported_attitude
from scipy.spatial.transform import Rotation

from fwav_companion.estimation.errors import LEVER, NAMES
from fwav_companion.estimation.measurement import Poses, feet, project

SIZES = np.array([0.03, 0.02, -0.03, 0.025, 0.05, 0.01, -0.012, 0.4, 0.2, 0.1, -0.05, 0.08, 0.06])
TARGETS = np.array([[3.0, -4.0, 8.0], [2.0, 6.0, -1.0], [0.0, 1.5, -0.5]])
GIMBAL_SHIFT = 0.02
ROW = np.full(3, 0.4)


def motion(t):
    """True position NED and (yaw, pitch, roll) of a vehicle that turns, climbs and shakes."""
    t = np.atleast_1d(t)
    position = np.stack([1.0 + 4.0 * t, -2.0 + 1.5 * t, -12.0 - 0.8 * t], -1)
    ypr = np.stack([0.4 + 0.9 * t, 0.3 + 0.5 * np.sin(2 * t), -0.2 + 0.6 * t], -1)
    return position, ypr


def reported_poses(errors, stamp):
    """What telemetry with these errors says at the time `stamp`."""
    position, ypr = motion(stamp)
    rotation = reported_attitude(Rotation.from_euler("ZYX", ypr), ypr, errors)
    late, late_ypr = motion(stamp - errors[8])
    lever = Rotation.from_euler("ZYX", ypr).apply(errors[LEVER])
    place = (late + lever) * [1, 1, -1] + [0, 0, errors[7]]
    del late_ypr, position
    return place, rotation


def poses_for(errors, stamp, estimate, gimbal_delay=0.0):
    """Poses as the package receives them, at the stamp minus the estimated delay."""
    t, step = stamp - estimate[0] - ROW[0] * estimate[12], 1e-4
    shift = estimate[14] if len(estimate) > 13 else 0.0
    place, _ = reported_poses(errors, t)
    before, after = (reported_poses(errors, t + d)[0] for d in (-step, step))
    rotation = reported_poses(errors, t + shift - gimbal_delay)[1]
    a, b = (reported_poses(errors, t + shift - gimbal_delay + d)[1] for d in (-step, step))
    rate = (a.inv() * b).as_rotvec() / (2 * step)
    velocity = (after - before) / (2 * step)
    m = np.moveaxis(rotation.as_matrix(), 0, -1)
    level = np.stack([0 * m[2, 2], m[2, 2], -m[2, 1]])
    level /= np.linalg.norm(level, axis=0)
    return Poses(m, place.T, velocity.T, velocity.T, rate.T, level)


def observed(errors, capture):
    """True rays of the targets in the axes of the configured camera, and tangents of a noise of 1 mrad."""
    position, ypr = motion(capture)
    v = Rotation.from_euler("ZYX", ypr).inv().apply((TARGETS * [[1], [1], [-1]]).T - position)
    rays = (Rotation.from_rotvec(errors[1:4]).apply(v / np.linalg.norm(v, axis=1)[:, None])).T
    tangents = np.empty((2, 3, rays.shape[1]))
    for i, ray in enumerate(rays.T):
        first = np.cross(ray, [0.0, 1.0, 0.0])
        first /= np.linalg.norm(first)
        tangents[..., i] = np.stack([first, np.cross(ray, first)]) * 1000.0
    return rays, tangents


@pytest.mark.parametrize("index", range(13), ids=PLANTED)
def test_residual_vanishes_at_the_planted_error(index):
    errors = np.zeros(13)
    errors[index] = SIZES[index]
    capture = 0.3
    stamp = capture + errors[0] + ROW[0] * errors[12]
    rays, tangents = observed(errors, capture)
    at_truth = project(poses_for(errors, stamp, errors), rays, tangents, errors, TARGETS, np.zeros((3, 1)), ROW)
    at_zero = project(poses_for(errors, stamp, 0 * errors), rays, tangents, 0 * errors, TARGETS, np.zeros((3, 1)), ROW)
    assert np.abs(at_zero.residual).max() > 3.0
    assert np.abs(at_truth.residual).max() < 0.03 * np.abs(at_zero.residual).max()


def test_residual_vanishes_at_the_planted_gimbal_delay():
    shared = np.zeros(15)
    shared[14] = GIMBAL_SHIFT
    rays, tangents = observed(np.zeros(13), 0.3)
    poses = poses_for(np.zeros(13), 0.3, shared, GIMBAL_SHIFT)
    found = project(poses, rays, tangents, shared, TARGETS, np.zeros((3, 1)), ROW)
    assert np.abs(found.residual).max() < 1e-6


@pytest.mark.parametrize("index", range(15), ids=NAMES)
def test_jacobian_is_the_numerical_difference_by_a_shared_parameter(index):
    estimate = np.zeros(15)
    estimate[:13] = 0.3 * SIZES
    rays, tangents = observed(np.zeros(13), 0.3)
    tangents = tangents / 1000.0

    def residual(x):
        return project(poses_for(np.zeros(13), 0.3, x), rays, tangents, x, TARGETS, np.zeros((3, 1)), ROW).residual

    exact = project(poses_for(np.zeros(13), 0.3, estimate), rays, tangents, estimate, TARGETS, np.zeros((3, 1)), ROW)
    step = np.zeros(15)
    step[index] = 1e-5
    numeric = -(residual(estimate + step) - residual(estimate - step)) / 2e-5
    assert exact.shared[:, index] == pytest.approx(numeric, abs=0.02 * np.abs(numeric).max() + 1e-7)


@pytest.mark.parametrize("axis", range(3))
def test_jacobian_by_the_apparent_place_is_that_of_target_and_of_error(axis):
    shared = np.zeros(13)
    rays, tangents = observed(shared, 0.3)
    poses, d = poses_for(shared, 0.3, shared), np.zeros((3, 1))
    d[axis] = 1e-4

    def residual(target, error):
        return project(poses, rays, tangents, shared, target, error, ROW).residual

    zero = np.zeros((3, 1))
    point = project(poses, rays, tangents, shared, TARGETS, zero, ROW).point[:, axis]
    by_target = -(residual(TARGETS + d, zero) - residual(TARGETS - d, zero)) / 2e-4
    by_error = -(residual(TARGETS, d) - residual(TARGETS, -d)) / 2e-4
    assert by_target == pytest.approx(point, rel=1e-4, abs=1e-3)
    assert by_error == pytest.approx(point, rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("index", range(13), ids=PLANTED)
def test_feet_are_the_targets_at_the_planted_error(index):
    errors = np.zeros(13)
    errors[index] = SIZES[index]
    rays, _ = observed(errors, 0.3)
    level = TARGETS.copy()
    poses = poses_for(errors, 0.3 + errors[0] + ROW[0] * errors[12], errors)
    for i in range(3):
        place, meets = feet(poses, rays, errors, np.zeros((3, 1)), float(level[2, i]))
        assert meets[i]
        assert place[:, i] == pytest.approx(level[:2, i], abs=0.02)


def test_a_target_behind_the_camera_is_not_visible_and_has_no_derivatives():
    rays, tangents = observed(np.zeros(13), 0.3)
    found = project(
        poses_for(np.zeros(13), 0.3, np.zeros(13)), -rays, tangents, np.zeros(13), TARGETS, np.zeros((3, 1)), ROW
    )
    assert not found.visible.any()
    assert not found.shared.any()
    assert not found.residual.any()
