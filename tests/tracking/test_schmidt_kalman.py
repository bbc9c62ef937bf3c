"""The Schmidt-Kalman update against numpy's, with every bias in one plain state."""

from math import inf

import numpy as np
import pytest

from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import Measurement
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate, gate_result, kalman_gain, update

COUNT, WANDERING, TIMED = 7, 5, 2
"""Number of biases, index of the first wandering one (the last two wander), index of the time offset."""


def rows(rng, *, level):
    values = rng.normal(0, 0.5, (3, COUNT))
    return tuple(map(tuple, values * [[1], [1], [0 if level else 1]]))


def noise(rng, *, level):
    a = rng.normal(0, 0.3, (3, 3))
    if level:
        a[2, :2] = a[:2, 2] = 0.0
    return tuple(map(tuple, a @ a.T + 0.01 * np.eye(3)))


def some(rng, *, level=False):
    position = tuple(rng.normal(0, 1.0, 3))
    a = rng.normal(0, 0.2, (2, 2))
    a = a @ a.T
    scatter = AdaptiveNoise(0.03, 0.2, 10)
    own = PointEstimate(
        position, noise(rng, level=level), rows(rng, level=level), WANDERING, (a[0, 0], a[0, 1], a[1, 1]), scatter
    )
    fix = Measurement(tuple(rng.normal(0, 10.0, 3)), noise(rng, level=level), rows(rng, level=level), GATE)
    return own, fix


def grown(forgotten):
    nn, ne, ee = forgotten
    return np.array([[nn, ne, 0], [ne, ee, 0], [0, 0, 0]])


def covariance(estimate):
    """Covariance of (error, biases), as one plain matrix."""
    shared = np.array(estimate.shared)
    own = np.array(estimate.noise) + grown(estimate.forgotten) + shared @ shared.T
    return np.block([[own, shared], [shared.T, np.eye(COUNT)]])


def test_a_surprise_is_the_mahalanobis_distance_of_the_difference_and_nothing_near_is_out_of_sight():
    rng, far = np.random.default_rng(3), 0
    for _ in range(300):
        own, fix = some(rng)
        apart = np.array(fix.shared) - np.array(own.shared)
        apart[:, TIMED] *= np.sqrt(own.scatter.doubt)
        cov = np.array(own.noise) + np.array(fix.noise) + grown(own.forgotten) + apart @ apart.T
        cov = cov[:2, :2] + own.scatter.variance * np.eye(2)
        difference = np.subtract(fix.position, own.position)[:2]
        distance2 = difference @ np.linalg.solve(cov, difference)
        reported = gate_result(own, fix, TIMED)
        if reported.nis == inf:
            far += 1
            assert distance2 > GATE
            continue
        assert reported.nis == pytest.approx(distance2, rel=1e-9)
        assert reported.log_det_ratio == pytest.approx(
            np.log(np.linalg.det(cov) / np.linalg.det(np.array(fix.noise)[:2, :2]))
        )
    assert 60 < far < 240


@pytest.mark.parametrize("level", [False, True])
def test_a_blend_is_the_plain_joint_covariance(level):
    rng = np.random.default_rng(4)
    for _ in range(30):
        own, fix = some(rng, level=level)
        gain = kalman_gain(own, fix)
        p, r = np.array(own.noise), np.array(fix.noise)
        assert np.array(gain) == pytest.approx(p @ np.linalg.inv(p + r), abs=1e-12)
        rest, k = np.eye(3) - np.array(gain), np.array(gain)
        new = update(own, fix, gain, tuple(map(tuple, rest @ p @ rest.T + k @ r @ k.T)), TIMED)
        moved = np.block([[rest, k @ np.array(fix.shared)], [np.zeros((COUNT, 3)), np.eye(COUNT)]])
        expected = moved @ covariance(own) @ moved.T
        expected[:3, :3] += k @ r @ k.T
        assert np.array(new.shared) == pytest.approx(expected[:3, 3:], abs=1e-12)
        # The earlier values of the wandering biases are tracked horizontally only.
        assert np.array(new.cov)[:2, :2] == pytest.approx(expected[:2, :2], abs=1e-12)
        if level:
            assert np.array(new.cov) == pytest.approx(expected[:3, :3], abs=1e-12)


def test_fading_changes_no_covariance_but_that_with_the_biases_to_come():
    own, _ = some(np.random.default_rng(5))
    kept = 0.8
    new = own.faded(kept)
    fade = np.diag([1.0] * WANDERING + [kept] * (COUNT - WANDERING))
    assert np.array(new.shared) == pytest.approx(np.array(own.shared) @ fade)
    assert np.array(new.cov)[:2, :2] == pytest.approx(np.array(own.cov)[:2, :2], abs=1e-12)
    assert np.array(new.relative_cov) == pytest.approx(np.array(own.relative_cov), abs=1e-12)
