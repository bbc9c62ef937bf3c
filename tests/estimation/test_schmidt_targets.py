"""Targets that do not teach: their beginning, motion and take-over, against the joint Kalman filter."""

import numpy as np
import pytest

from fwav_companion.estimation.schmidt_targets import ACCELERATION_M_S2, FIRST_SPEED_M_S, SchmidtTargets

N = 4
RNG = np.random.default_rng(3)
HALF = RNG.standard_normal((N, N))
BASE = HALF @ HALF.T + 0.1 * np.eye(N)
OWN = np.array([[1.5, 0.2, 0.3], [-0.1, 2.0, 0.1]])
BY_BASE = RNG.standard_normal((2, N))
NOISE = np.array([[1.3, 0.2], [0.2, 0.9]])


def none():
    return SchmidtTargets.of_solve(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3, N)))


def begun(*, moving=False, height_variance=0.04):
    targets = none()
    targets.begin(7, np.array([1.0, 2.0, 0.5]), OWN, BY_BASE, BASE, NOISE, height_variance, moving=moving)
    return targets


def updated(joint, h, noise):
    """The covariance of a joint Gaussian after a measurement."""
    s = h @ joint @ h.T + noise
    return joint - joint @ h.T @ np.linalg.solve(s, h @ joint)


def test_first_sighting_gives_what_a_wide_prior_would():
    joint = np.zeros((N + 3, N + 3))
    joint[:N, :N], joint[N:, N:] = BASE, np.diag([1e7, 1e7, 0.04])
    oracle = updated(joint, np.hstack([BY_BASE, OWN]), NOISE)
    mean, covariance, cross, moving = begun().state(7)
    assert covariance[:3, :3] == pytest.approx(oracle[N:, N:], rel=1e-4, abs=1e-4)
    assert cross[:3] == pytest.approx(oracle[N:, :N], rel=1e-4, abs=1e-4)
    assert mean.tolist() == [1.0, 2.0, 0.5, 0.0, 0.0]
    assert not moving


def test_moving_target_goes_by_its_velocity_with_white_acceleration():
    targets = begun(moving=True)
    before = targets.state(7)
    targets.mean[0, 3:] = (1.0, -0.5)
    covariance, cross = before[1].copy(), before[2].copy()
    steps, dt = 4000, 0.8
    step = np.eye(5)
    step[0, 3] = step[1, 4] = dt / steps
    for _ in range(steps):  # oracle: many small steps
        covariance = step @ covariance @ step.T
        covariance[[3, 4], [3, 4]] += ACCELERATION_M_S2**2 * dt / steps
        cross = step @ cross
    targets.predict(dt)
    mean, found, with_base, _ = targets.state(7)
    assert mean == pytest.approx([1.8, 1.6, 0.5, 1.0, -0.5])
    assert found == pytest.approx(covariance, rel=1e-3, abs=1e-4)
    assert with_base == pytest.approx(cross)
    assert found[3, 3] == pytest.approx(FIRST_SPEED_M_S**2 + ACCELERATION_M_S2**2 * dt)


def test_static_target_stays():
    targets = begun()
    before = targets.covariance.copy()
    targets.predict(3.0)
    assert targets.covariance == pytest.approx(before)


def test_target_taken_over_is_where_a_joint_filter_has_it_after_the_same_news_of_the_base_state():
    mean, covariance, cross, _ = begun().state(7)
    joint = np.zeros((N + 5, N + 5))
    joint[:N, :N], joint[N:, N:], joint[N:, :N], joint[:N, N:] = BASE, covariance, cross, cross.T
    h, noise, residual = np.hstack([RNG.standard_normal((2, N)), np.zeros((2, 5))]), 0.05 * np.eye(2), np.array([2, -1])
    gain = joint @ h.T @ np.linalg.inv(h @ joint @ h.T + noise)
    after, moved = updated(joint, h, noise), gain @ residual
    targets = none()
    targets.take_over(
        7, mean, covariance, cross, moving=False, before=(np.zeros(N), BASE), after=(moved[:N], after[:N, :N]),
        index=np.arange(N),
    )  # fmt: skip
    found = targets.state(7)
    assert found[0] == pytest.approx(mean + moved[N:], abs=1e-6)
    assert found[1] == pytest.approx(after[N:, N:], abs=1e-6)
    assert found[2] == pytest.approx(after[N:, :N], abs=1e-6)


def test_update_is_the_joint_one_for_the_target_alone():
    targets = begun()
    _, covariance, cross, _ = targets.state(7)
    joint = np.zeros((N + 5, N + 5))
    joint[:N, :N], joint[N:, N:], joint[N:, :N], joint[:N, N:] = BASE, covariance, cross, cross.T
    own, by_base = np.array([[1.0, 0.4, 0.0], [0.1, 1.1, 0.2]]), RNG.standard_normal((2, N))
    h = np.hstack([by_base, own, np.zeros((2, 2))])
    oracle, s = updated(joint, h, np.eye(2)), h @ joint @ h.T + np.eye(2)
    targets.update(7, own, by_base, s, np.array([0.3, 0.1]), BASE)
    _, covariance, cross, _ = targets.state(7)
    assert covariance == pytest.approx(oracle[N:, N:], abs=1e-9)
    assert cross == pytest.approx(oracle[N:, :N], abs=1e-9)


def test_deleted_and_renamed_targets_leave_the_others():
    targets = begun()
    for number in (8, 9):
        targets.begin(number, np.full(3, float(number)), OWN, BY_BASE, BASE, NOISE, 0.04, moving=False)
    targets.delete(8)
    targets.rename(9, 7)
    assert set(targets.at) == {7}
    assert targets.place(7).tolist() == [9.0, 9.0, 9.0]
