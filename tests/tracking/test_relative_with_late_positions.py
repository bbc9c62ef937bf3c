"""The target relative to a moving vehicle whose reports are late: claims with and without a fix of this instant."""

from types import SimpleNamespace

import numpy as np
import pytest
from handmade import a_fix, host_ns
from scipy.stats import chi2
from simulated_flight import priors

from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.self_calibrated import place_cov
from fwav_companion.types import BIAS_COUNT, Bias

DELAY_S, NOISE_M, POSITION_M = 0.1, 0.1, 0.05
PRIORS = priors(position_delay=DELAY_S, position_noise_m=POSITION_M)
FLIGHTS = 40


def velocity(t):
    """Circles of 12 s at 5 m/s."""
    return 5.0 * np.array((np.cos(2.0 * np.pi * t / 12.0), np.sin(2.0 * np.pi * t / 12.0)))


def flown(rng):
    """(state after fixes for a circle and a half, delay)."""
    delay_s, state = DELAY_S * rng.standard_normal(), None
    for t in np.arange(0.0, 18.0, 0.4):
        jacobian = np.zeros((3, BIAS_COUNT))
        jacobian[:2, Bias.POSITION_DELAY] = -velocity(t)
        position = -velocity(t) * delay_s + np.hypot(NOISE_M, POSITION_M) * rng.standard_normal(2)
        noise = np.diag([NOISE_M**2 + POSITION_M**2, NOISE_M**2 + POSITION_M**2, 0.01])
        fix = a_fix(float(t), (*position, 0.0), noise, jacobian, PRIORS.bias_sigmas)
        state = StaticKalman(PRIORS).initiate(fix) if state is None else state.predict(host_ns(float(t))).update(fix)
    return state, delay_s


def square(error, cov):
    return float(error @ np.linalg.solve(np.array(cov)[:2, :2], error))


def test_while_a_target_is_out_of_view_its_claim_holds_the_delay_of_the_report():
    """Seconds after the last fix the vehicle has any course. The error is along it, so a square is twice one of one
    degree of freedom; without the delay in the claim their mean is 47.
    """
    rng, squares = np.random.default_rng(7), []
    for _ in range(FLIGHTS):
        state, delay_s = flown(rng)
        state, t = state.predict(host_ns(20.0)), rng.uniform(18.0, 30.0)
        report = -velocity(t) * delay_s + POSITION_M * rng.standard_normal(2)
        squares.append(square(np.array(state.apparent_ned[:2]) - report, state.relative_cov))
    low, high = chi2.ppf([0.001, 0.999], FLIGHTS)
    assert low < 0.5 * sum(squares) < high


@pytest.mark.parametrize("known", [1.0, 0.01])
def test_a_calibrated_place_is_claimed_with_the_delay_that_is_left(known):
    """The covariance lies along the course of the last fix."""
    state, _ = flown(np.random.default_rng(1))
    left = SimpleNamespace(position_delay_share=known)
    calibrator = SimpleNamespace(context=SimpleNamespace(priors=PRIORS), assessment=left)
    nn, ne, ee = place_cov(calibrator, SimpleNamespace(relative_cov=(0.02, 0.0, 0.03)), state)
    expected = np.diag([0.02, 0.03]) + POSITION_M**2 * np.eye(2)
    expected += known * DELAY_S**2 * np.outer(velocity(17.6), velocity(17.6))
    assert np.array([[nn, ne], [ne, ee]]) == pytest.approx(expected)
