"""The Schmidt-Kalman update against numpy's, with states and biases in one plain state."""

from math import inf

import numpy as np
import pytest

from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import Measurement
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.schmidt_kalman import (
    PlaceEstimate,
    StandingEstimate,
    gate_result,
    relative_estimate,
)

COUNT, TIMED, DELAYED = 7, 2, 4
"""Number of biases, indices of the time offset and of the position delay."""


def tuples(a):
    return tuple(tuple(row) for row in np.asarray(a).tolist())


def positive(rng, size, floor=0.01):
    a = rng.normal(0, 0.3, (size, size))
    return a @ a.T + floor * np.eye(size)


def some(rng, states=6):
    own = StandingEstimate(
        tuple(rng.normal(0, 1.0, states).tolist()),
        tuples(positive(rng, states)),
        tuples(rng.normal(0, 0.5, (states, COUNT))),
    )
    noise = np.zeros((3, 3))
    noise[:2, :2], noise[2, 2] = positive(rng, 2, 0.1), 0.01
    shared = rng.normal(0, 0.5, (3, COUNT)) * [[1], [1], [0]]
    return own, Measurement(tuple(rng.normal(0, 10.0, 3).tolist()), tuples(noise), tuples(shared), GATE)


def joint(estimate):
    """Covariance of (states, biases), as one plain matrix."""
    shared = np.array(estimate.shared)
    return np.block([[np.array(estimate.noise) + shared @ shared.T, shared], [shared.T, np.eye(COUNT)]])


def test_the_gate_is_the_mahalanobis_distance_of_the_difference_and_nothing_near_is_outside():
    rng, far, scatter = np.random.default_rng(3), 0, AdaptiveNoise(0.03, 0.2, 10)
    for _ in range(300):
        own, fix = some(rng)
        apart = (np.array(fix.shared) - np.vstack([np.array(own.shared)[:2], np.zeros(COUNT)]))[:2]
        apart[:, TIMED] *= np.sqrt(scatter.doubt)
        cov = np.array(own.noise)[:2, :2] + np.array(fix.noise)[:2, :2] + apart @ apart.T + scatter.variance * np.eye(2)
        difference = np.subtract(fix.position[:2], own.mean[:2])
        nis = difference @ np.linalg.solve(cov, difference)
        reported = gate_result(own.apparent, scatter, fix, TIMED)
        if reported.nis == inf:
            far += 1
            assert nis > GATE
            continue
        assert reported.nis == pytest.approx(nis, rel=1e-9)
        noise = np.array(fix.noise)[:2, :2]
        assert reported.log_det_ratio == pytest.approx(np.log(np.linalg.det(cov) / np.linalg.det(noise)))
    assert 60 < far < 240


@pytest.mark.parametrize("states", [2, 6])
def test_an_update_is_that_of_the_plain_joint_state(states):
    """The gain is the Kalman gain's rows of the states; the rows of the biases are zero (Schmidt)."""
    rng = np.random.default_rng(4)
    for _ in range(30):
        own, fix = some(rng, states)
        observed = np.hstack([np.eye(2, states), np.array(fix.shared)[:2]])
        # The error of the innovation is noise + J b - H e: the biases enter with the other sign than the states.
        observed[:, :states] *= -1.0
        before, noise = joint(own), np.array(fix.noise)[:2, :2]
        innovation = own.innovation(fix)
        spread = observed @ before @ observed.T + noise
        (nn, ne, ee) = innovation.cov
        assert np.array([[nn, ne], [ne, ee]]) == pytest.approx(spread, abs=1e-12)
        gain = -(before @ observed.T)[:states] @ np.linalg.inv(spread)
        assert np.array(own.kalman_gain(innovation)) == pytest.approx(gain, abs=1e-9)
        for chosen in (gain, rng.normal(0.0, 0.3, (states, 2))):
            new = own.update(innovation, tuples(chosen))
            moved = np.eye(states + COUNT) + np.vstack([chosen, np.zeros((COUNT, 2))]) @ observed
            expected = moved @ before @ moved.T
            expected[:states, :states] += chosen @ noise @ chosen.T
            assert joint(new) == pytest.approx(expected, abs=1e-12)
            assert new.mean == pytest.approx(
                np.array(own.mean) + chosen @ (np.subtract(fix.position, 0)[:2] - own.mean[:2])
            )


def test_a_gain_of_any_other_size_is_worse():
    rng = np.random.default_rng(5)
    for _ in range(30):
        own, fix = some(rng)
        innovation = own.innovation(fix)
        best = np.array(own.kalman_gain(innovation))
        least = np.trace(joint(own.update(innovation, tuples(best)))[:6, :6])
        for _ in range(5):
            other = own.update(innovation, tuples(best + rng.normal(0.0, 0.02, (6, 2))))
            assert np.trace(joint(other)[:6, :6]) > least


def test_relative_to_the_report_of_this_fix_its_noise_and_its_delay_cancel():
    """In one plain state with the noise of this report: apparent place + noise + the delay's share of this fix."""
    rng, report = np.random.default_rng(6), 0.05
    for _ in range(20):
        own, fix = some(rng)
        innovation = own.innovation(fix)
        by_delay = (DELAYED, fix.shared[0][DELAYED], fix.shared[1][DELAYED])
        found = relative_estimate(own, innovation, report, by_delay)
        apparent, delay = own.apparent, np.array(by_delay[1:])
        # States: error of the apparent place, noise of this report, biases.
        cov = np.zeros((4 + COUNT, 4 + COUNT))
        shared = np.array(apparent.shared)
        nn, ne, ee = apparent.cov
        cov[:2, :2], cov[2:4, 2:4], cov[4:, 4:] = [[nn, ne], [ne, ee]], report * np.eye(2), np.eye(COUNT)
        cov[:2, 4:], cov[4:, :2] = shared, shared.T
        wanted = np.hstack([np.eye(2), -np.eye(2), np.zeros((2, COUNT))])
        wanted[:, 4 + DELAYED] -= delay
        seen = np.hstack([-np.eye(2), np.eye(2), np.array(fix.shared)[:2]])
        noise = np.array(fix.noise)[:2, :2] - report * np.eye(2)
        spread = seen @ cov @ seen.T + noise
        gain = -(wanted @ cov @ seen.T) @ np.linalg.inv(spread)
        total = wanted @ cov @ wanted.T - gain @ spread @ gain.T
        nn, ne, ee = found.cov
        assert np.array([[nn, ne], [ne, ee]]) == pytest.approx(total, abs=1e-9)
        step = gain @ (np.array(fix.position[:2]) - (apparent.north_m, apparent.east_m))
        assert (found.north_m, found.east_m) == pytest.approx((apparent.north_m + step[0], apparent.east_m + step[1]))


def test_a_jump_frees_the_apparent_place_and_its_rate_and_leaves_the_place():
    own, _ = some(np.random.default_rng(7))
    new = own.with_jump((0.2, 0.05, 0.1), 2.0)
    more = np.array(new.noise) - np.array(own.noise)
    jump = np.array([[0.2, 0.05], [0.05, 0.1]])
    assert more[:2, :2] == pytest.approx(jump)
    assert more[:2, 4:] == pytest.approx(2.0 * jump)
    assert more[4:, 4:] == pytest.approx(4.0 * jump)
    assert more[2:4] == pytest.approx(np.zeros((2, 6)))


def test_a_covariance_has_noise_and_biases():
    place = PlaceEstimate(1.0, 2.0, (0.3, 0.1, 0.2), ((1.0, 2.0), (3.0, -1.0)))
    assert place.cov == pytest.approx((5.3, 1.1, 10.2))
