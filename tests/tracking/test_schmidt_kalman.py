"""The Schmidt-Kalman update against numpy's, with states and biases in one plain state."""

from math import inf

import numpy as np
import pytest

from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import Measurement
from fwav_companion.tracking.filters.gate_results import gate_results
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.relative_estimate import relative_estimate
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate

COUNT, TIMED, DELAYED = 7, 2, 4
"""Number of biases, indices of the time offset and of the position delay."""


def tuples(a):
    return tuple(tuple(row) for row in np.asarray(a).tolist())


def positive(rng, size, floor=0.01):
    a = rng.normal(0, 0.3, (size, size))
    return a @ a.T + floor * np.eye(size)


def some(rng):
    nn, ne, ee = np.array(positive(rng, 2))[[0, 0, 1], [0, 1, 1]].tolist()
    north, east = rng.normal(0, 1.0, 2).tolist()
    own = PointEstimate(north, east, (nn, ne, ee), tuples(rng.normal(0, 0.5, (2, COUNT))))
    noise = np.zeros((3, 3))
    noise[:2, :2], noise[2, 2] = positive(rng, 2, 0.1), 0.01
    shared = rng.normal(0, 0.5, (3, COUNT)) * [[1], [1], [0]]
    return own, Measurement(tuple(rng.normal(0, 10.0, 3).tolist()), tuples(noise), tuples(shared), GATE)


def square(symmetric):
    nn, ne, ee = symmetric
    return np.array([[nn, ne], [ne, ee]])


def place_of(estimate):
    return np.array([estimate.north_m, estimate.east_m])


def joint(estimate):
    """Covariance of (states, biases), as one plain matrix."""
    shared = np.array(estimate.shared)
    return np.block([[square(estimate.noise) + shared @ shared.T, shared], [shared.T, np.eye(COUNT)]])


def test_the_gate_is_the_mahalanobis_distance_of_the_difference_and_nothing_near_is_outside():
    rng, far, scatter = np.random.default_rng(3), 0, AdaptiveNoise(0.03, 0.2, 10)
    for _ in range(300):
        own, fix = some(rng)
        apart = np.array(fix.shared)[:2] - np.array(own.shared)
        apart[:, TIMED] *= np.sqrt(scatter.doubt)
        cov = square(own.noise) + np.array(fix.noise)[:2, :2] + apart @ apart.T + scatter.variance * np.eye(2)
        difference = fix.position[:2] - place_of(own)
        nis = difference @ np.linalg.solve(cov, difference)
        reported = gate_results(own, scatter, [fix], TIMED)[0]
        if reported.nis == inf:
            far += 1
            assert nis > GATE
            continue
        assert reported.nis == pytest.approx(nis, rel=1e-9)
        noise = np.array(fix.noise)[:2, :2]
        assert reported.log_det_ratio == pytest.approx(np.log(np.linalg.det(cov) / np.linalg.det(noise)))
    assert 60 < far < 240


def test_an_update_is_that_of_the_plain_joint_state():
    """The gain is the Kalman gain's rows of the point; the rows of the biases are zero (Schmidt)."""
    rng = np.random.default_rng(4)
    for _ in range(30):
        own, fix = some(rng)
        # The error of the innovation is noise + J b - e: the biases enter with the other sign than the point.
        observed = np.hstack([-np.eye(2), np.array(fix.shared)[:2]])
        before, noise = joint(own), np.array(fix.noise)[:2, :2]
        innovation = own.innovation(fix)
        spread = observed @ before @ observed.T + noise
        assert square(innovation.cov) == pytest.approx(spread, abs=1e-12)
        assert np.array(innovation.shared) == pytest.approx(np.array(fix.shared)[:2] - np.array(own.shared))
        gain = -(before @ observed.T)[:2] @ np.linalg.inv(spread)
        assert np.reshape(innovation.gain, (2, 2)) == pytest.approx(gain, abs=1e-9)
        for chosen in (gain, rng.normal(0.0, 0.3, (2, 2))):
            new = own.update(innovation, tuple(chosen.ravel().tolist()))
            moved = np.eye(2 + COUNT) + np.vstack([chosen, np.zeros((COUNT, 2))]) @ observed
            expected = moved @ before @ moved.T
            expected[:2, :2] += chosen @ noise @ chosen.T
            assert joint(new) == pytest.approx(expected, abs=1e-12)
            assert place_of(new) == pytest.approx(place_of(own) + chosen @ (fix.position[:2] - place_of(own)))


def test_a_gain_of_any_other_size_is_worse():
    rng = np.random.default_rng(5)
    for _ in range(30):
        own, fix = some(rng)
        innovation = own.innovation(fix)
        best = np.array(innovation.gain)
        least = np.trace(square(own.update(innovation, tuple(best.tolist())).cov))
        for _ in range(5):
            other = own.update(innovation, tuple((best + rng.normal(0.0, 0.02, 4)).tolist()))
            assert np.trace(square(other.cov)) > least


def test_relative_to_the_report_of_this_fix_its_noise_and_its_delay_cancel():
    """In one plain state with the noise of this report: apparent place + noise + the delay's share of this fix."""
    rng, report = np.random.default_rng(6), 0.05
    for _ in range(20):
        own, fix = some(rng)
        by_delay = (DELAYED, fix.shared[0][DELAYED], fix.shared[1][DELAYED])
        row = rng.normal(0.0, 1.0, COUNT)
        found = relative_estimate(
            own,
            own.innovation(fix),
            fix.noise,
            position_noise_m2=report,
            by_delay=by_delay,
            down=tuple(row.tolist()),
        )
        delay = np.array(by_delay[1:])
        # States: error of the apparent place, noise of this report, biases.
        cov = np.zeros((4 + COUNT, 4 + COUNT))
        shared = np.array(own.shared)
        cov[:2, :2], cov[2:4, 2:4], cov[4:, 4:] = square(own.cov), report * np.eye(2), np.eye(COUNT)
        cov[:2, 4:], cov[4:, :2] = shared, shared.T
        wanted = np.hstack([np.eye(2), -np.eye(2), np.zeros((2, COUNT))])
        wanted[:, 4 + DELAYED] -= delay
        seen = np.hstack([-np.eye(2), np.eye(2), np.array(fix.shared)[:2]])
        noise = np.array(fix.noise)[:2, :2] - report * np.eye(2)
        spread = seen @ cov @ seen.T + noise
        gain = -(wanted @ cov @ seen.T) @ np.linalg.inv(spread)
        total = wanted @ cov @ wanted.T - gain @ spread @ gain.T
        assert square(found.cov) == pytest.approx(total, abs=1e-9)
        assert place_of(found) == pytest.approx(place_of(own) + gain @ (fix.position[:2] - place_of(own)))
        expected = wanted @ cov[:, 4:] @ row + gain @ seen @ cov[:, 4:] @ row
        assert found.down_cov == pytest.approx(tuple(expected), abs=1e-9)


def test_a_covariance_has_noise_and_biases():
    place = PointEstimate(1.0, 2.0, (0.3, 0.1, 0.2), ((1.0, 2.0), (3.0, -1.0)))
    assert place.cov == pytest.approx((5.3, 1.1, 10.2))
