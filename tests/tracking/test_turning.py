"""How much of told rates is a body's turning: attitudes with white noise, their slopes, and what is made of them."""

from math import cos, pi, radians

import numpy as np
import pytest

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.nouns import AttitudeSample, GimbalAt, VehicleState
from fwav_companion.telemetry.history import AttitudeHistory
from fwav_companion.tracking.turning import Turning

NOISE = radians(0.1)
SPACING_S = 0.02


def turning(roll_rate, seconds: float, seed: int, noise: float = NOISE) -> Turning:
    """Of a body that rolls as told and does nothing else; rates and spacing by the room that makes them."""
    draws, history, found = np.random.default_rng(seed), AttitudeHistory(), Turning()
    roll, told = 0.0, 0.0
    for k in range(int(seconds / SPACING_S)):
        roll += SPACING_S * roll_rate((k - 0.5) * SPACING_S)
        x, y, z = np.multiply(0.5, (roll, 0.0, 0.0) + noise * draws.normal(size=3))
        q = np.array([1.0, x, y, z]) / np.linalg.norm([1.0, x, y, z])
        history.insert(AttitudeSample(BootNs(int(k * SPACING_S * 1e9)), tuple(map(float, q)), (0.0, 0.0, 0.0)))
        while told < (k - 4) * SPACING_S:
            at = history.at(BootNs(int(told * 1e9)))
            state = VehicleState(
                BootNs(0), at.ned_from_body, at.rates, at.sigma, at.gap_s, None, None, 0.0, None, spacing_s=at.spacing_s
            )
            found = found.with_state(state, NOISE)
            told += 1.0 / 30.0
    return found


@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_shows_no_turning(seed: int):
    assert max(turning(lambda t: 0.0, 8.0, seed).shares) < 0.3


def test_a_beating_wing_turns_and_only_about_its_axis():
    def beat(t):
        return radians(5.0) * 2.0 * pi * 5.0 * cos(2.0 * pi * 5.0 * t)

    x, y, z = turning(beat, 8.0, 1).shares
    assert x > 0.97
    assert max(y, z) < 0.3


def test_what_noise_makes_of_slow_turning_is_undone_on_the_mean():
    """The reliability of a regressor: true mean square over told mean square."""
    rate, amplitude = 2.0 * pi * 0.5, radians(4.0)

    def slow(t):
        return amplitude * rate * cos(rate * t)

    shares = [turning(slow, 10.0, seed).shares[0] for seed in range(8)]
    noisy, clean = (turning(slow, 10.0, 1, noise).told2[0] for noise in (NOISE, 0.0))
    assert np.mean(shares) == pytest.approx(clean / noisy, abs=0.1)


def test_attitudes_of_unknown_spacing_say_nothing_of_noise():
    state = VehicleState(BootNs(0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.1), 0.0, 0.0, None, None, 0.0, None)
    assert Turning().with_state(state, NOISE).shares == (1.0, 1.0, 1.0)


def test_a_gimbal_is_not_judged_by_the_attitudes_of_the_body():
    gimbal = GimbalAt((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.05), 0.0, 0.0)
    level = ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.05), 0.0, 0.0, None, None, 0.0, None)
    body = VehicleState(BootNs(0), *level, spacing_s=SPACING_S)
    carried = VehicleState(BootNs(0), *level, spacing_s=SPACING_S, gimbal=gimbal)
    assert Turning().with_state(body, NOISE).shares[2] < 1.0
    assert Turning().with_state(carried, NOISE).shares == (1.0, 1.0, 1.0)
