"""The share of true rotation in reported rates: attitudes with white noise, their slopes, and the denoised rates."""

from math import cos, pi, radians

import msgspec
import numpy as np
import pytest
from draws import first_of
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.geometry.vectors import ZERO3
from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.rate_denoiser import RateDenoiser, denoised, slow_rates
from fwav_companion.telemetry.attitude.history import AttitudeHistory
from fwav_companion.types import AttitudeSample, GimbalAt, VehicleState

NOISE = radians(0.1)
SPACING_S = 0.02
STILL = VehicleState(BootNs(0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.05), 0.0, 0.0, None, None, 0.0, None)


def poses_of(state):
    return delayed_poses([state], (0.0,), None)


def rolled(roll_rate, seconds: float, seed: int, noise: float = NOISE):
    """(learned statistics, reported and denoised roll rates) at 30 instants a second, of a body with the chosen roll
    rate and no other motion; rates and spacing come from the telemetry package.
    """
    draws, history, found = np.random.default_rng(seed), AttitudeHistory(), RateDenoiser()
    roll, reported, freed = 0.0, [], []

    def state_at(t):
        at = history.at(BootNs(int(t * 1e9)))
        none = (None, None, 0.0, None)
        return VehicleState(BootNs(0), at.ned_from_body, at.rates, at.sigma, at.gap_s, *none, spacing_s=at.spacing_s)

    for k in range(int(seconds / SPACING_S)):
        roll += SPACING_S * roll_rate((k - 0.5) * SPACING_S)
        told_roll = Rotation.from_rotvec([roll, 0.0, 0.0]) * Rotation.from_rotvec(noise * draws.normal(size=3))
        q = np.roll(told_roll.as_quat(), 1)
        history.insert(AttitudeSample(BootNs(int(k * SPACING_S * 1e9)), tuple(map(float, q)), (0.0, 0.0, 0.0)))
        while (t := len(reported) / 30.0 + 0.2) < (k - 4) * SPACING_S - 0.15:
            state = state_at(t)
            slow = slow_rates(state_at(t - 0.15), state_at(t + 0.15))
            found = found.with_state(state, slow, NOISE)
            reported.append(state.rates[0])
            freed.append(denoised(poses_of(state), np.array([(slow, found.shares)])).rates[0, 0, 0])
    return found, np.array(reported), np.array(freed)


def turning(*chosen) -> RateDenoiser:
    return rolled(*chosen)[0]


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
    """The reliability of a regressor: true mean square over reported mean square."""
    rate, amplitude = 2.0 * pi * 0.5, radians(4.0)

    def slow(t):
        return amplitude * rate * cos(rate * t)

    shares = [turning(slow, 10.0, seed).shares[0] for seed in range(8)]
    noisy, clean = (turning(slow, 10.0, 1, noise).reported2[0] for noise in (NOISE, 0.0))
    assert np.mean(shares) == pytest.approx(clean / noisy, abs=0.1)


@pytest.mark.parametrize("seed", first_of(*range(4)))
def test_a_slow_turn_shows_a_delay_beside_what_else_explains_it(seed):
    """A delay adds delay times rate to an angle, and the mount adds a constant: most of a steady turn is equally
    explained by the mount. The rest of the rates is a seventh of their noise, and still shows the delay in full.
    """

    def banking(t):
        return radians(20.0) + radians(4.0) * cos(1.5 * t)

    delay, mount = 0.02, radians(1.0)
    _, reported, freed = rolled(banking, 20.0, seed)
    angle = mount + delay * np.array([banking(k / 30.0 + 0.2) for k in range(len(reported))])

    def shown(rates):
        return np.linalg.lstsq(np.stack([rates[60:], np.ones(len(rates) - 60)], -1), angle[60:], rcond=None)[0][0]

    assert shown(reported) < 0.5 * delay
    assert shown(freed) == pytest.approx(delay, rel=0.15)


def test_a_slope_that_is_noise_has_no_slope_of_its_own():
    """Acceleration comes from the same rates: over 50 ms the noise of it rotates a body by half a degree."""
    still = turning(lambda t: 0.0, 8.0, 1)
    poses = msgspec.structs.replace(
        poses_of(STILL), rates=np.array([[[0.1, 0.0, 0.0]]]), acceleration=np.array([[[10.0, 0.0, 0.0]]])
    )
    found = denoised(poses, np.array([(ZERO3, still.shares)]))
    assert found.acceleration[0, 0, 0] == pytest.approx(10.0 * still.shares[0])


def test_attitudes_of_unknown_spacing_say_nothing_of_noise():
    assert RateDenoiser().with_state(STILL, ZERO3, NOISE).shares == (1.0, 1.0, 1.0)


def test_a_gimbal_is_not_judged_by_the_attitudes_of_the_body():
    gimbal = GimbalAt((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.05), 0.0, 0.0)
    body = msgspec.structs.replace(STILL, spacing_s=SPACING_S)
    carried = msgspec.structs.replace(body, gimbal=gimbal)
    assert RateDenoiser().with_state(body, ZERO3, NOISE).shares[2] < 1.0
    assert RateDenoiser().with_state(carried, ZERO3, NOISE).shares == (1.0, 1.0, 1.0)
