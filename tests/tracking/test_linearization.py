"""The linearization point: smoothed height and running mean of the innovations."""

import numpy as np
import pytest

from fwav_companion.tracking.filters.linearization import CLIMB_DENSITY, first_point


def test_a_climbing_height_is_smoothed_as_by_a_kalman_filter_in_numpy():
    rng, sigma = np.random.default_rng(2), 0.3
    point, mean, cov = first_point(15.0, sigma), np.array([15.0, 0.0]), np.diag([sigma**2, 1.0])
    for dt in rng.uniform(0.1, 0.4, 200):
        height = 15.0 + rng.normal(0.0, sigma)
        point = point.with_height(height, dt, sigma)
        move = np.array([[1.0, dt], [0.0, 1.0]])
        more = CLIMB_DENSITY * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        mean, cov = move @ mean, move @ cov @ move.T + more
        gain = cov[:, 0] / (cov[0, 0] + sigma**2)
        mean, cov = mean + gain * (height - mean[0]), cov - np.outer(gain, cov[0])
        assert (point.height_m, point.climb_m_s) == pytest.approx(tuple(mean), abs=1e-9)
    assert np.sqrt(point.height_cov[0]) < 0.6 * sigma


def test_the_running_mean_follows_a_shift_within_two_seconds_and_forgets_noise():
    rng, point = np.random.default_rng(3), first_point(10.0, 0.1)
    offs = []
    for k in range(600):
        shift = 0.0 if k < 300 else 1.0
        point = point.with_innovation(shift + rng.normal(0.0, 0.2), 0.0, 1 / 30)
        offs.append(point.mean_n - shift)
    assert np.std(offs[60:300]) < 0.2 / 3
    assert abs(offs[360]) < 0.2
