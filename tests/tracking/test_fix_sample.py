"""Fixes as samples of the low-pass: the noise that successive fixes share, against numpy."""

import numpy as np
import pytest
from handmade import a_fix
from msgspec.structs import replace
from simulated_flight import priors

from fwav_companion.tracking.filters.fix_sample import DOWN_FLOOR_M2, TELEMETRY_STEP_S, FixSampler
from fwav_companion.types import BIAS_COUNT, Bias

ALL = priors(
    roll=0.01, pitch=0.02, position_north=1.0, position_east=2.0, height=0.5, position_delay=0.05,
    attitude_noise=0.004, position_noise_m=0.3, height_noise_m=0.2,
)  # fmt: skip
SIGMAS = np.array(ALL.bias_sigmas)
IN_ORDER = [bias for bias in Bias if SIGMAS[bias] > 0 and bias not in (Bias.POSITION_NORTH, Bias.POSITION_EAST)]


def drawn(seed, t=1.0):
    """A fix with any covariance and sensitivities, ten metres below the camera."""
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 0.3, (3, 3))
    return a_fix(t, (6.0, -4.0, 0.1), root @ root.T, rng.normal(0.0, 3.0, (3, BIAS_COUNT)), SIGMAS)


def jacobian_of(fix):
    return np.array(fix.bias_jacobian).T


def test_a_sample_has_a_column_for_each_bias_with_a_prior_but_none_for_the_wandering_position():
    fix = drawn(1)
    expected = jacobian_of(fix)[:, IN_ORDER] * SIGMAS[IN_ORDER]
    assert np.array(FixSampler(ALL).sample(fix).shared) == pytest.approx(expected)


def test_a_fix_is_converted_once_and_the_memory_holds_one_frame():
    sampler = FixSampler(ALL)
    for frame in range(5):
        fixes = [drawn(5, t=1.0 + frame) for _ in range(3)]
        for fix in fixes:
            assert sampler.sample(fix) is sampler.sample(fix)
        assert len(sampler._of_frame) == len(fixes)
    equal = replace(fixes[-1])
    assert sampler.sample(equal) is not sampler.sample(fixes[-1]), "another fix at any address is another fix"


@pytest.mark.parametrize(("since_s", "spacing_s"), [(0.03, 0.0), (0.03, 0.25), (0.2, 0.25), (0.0, 0.25), (0.4, 0.25)])
def test_noise_that_fixes_share_counts_as_often_as_they_share_it(since_s, spacing_s):
    """Of n fixes with one sample of telemetry, the mean has the variance of one: each must claim n times that."""
    fix = drawn(6)
    state = replace(fix.sighting.state, spacing_s=spacing_s)
    fix = replace(fix, sighting=replace(fix.sighting, state=state))
    jacobian, expected = jacobian_of(fix), np.array(fix.noise_cov) + np.diag([0.0, 0.0, DOWN_FLOOR_M2])
    times = max(0.0, TELEMETRY_STEP_S / max(since_s, 1e-3) - 1.0)
    by_height = jacobian[:, Bias.HEIGHT] * 0.2
    expected += times * (np.outer(by_height, by_height) + 0.3**2 * np.diag([1.0, 1.0, 0.0]))
    times = max(0.0, spacing_s / max(since_s, 1e-3) - 1.0)
    for axis in (Bias.ROLL, Bias.PITCH, Bias.HEADING):
        by_turn = jacobian[:, axis] * 0.004
        expected += times * np.outer(by_turn, by_turn)
    sample = FixSampler(ALL).next_sample(fix, since_s)
    assert np.array(sample.noise) == pytest.approx(expected)
    assert sample.shared == FixSampler(ALL).sample(fix).shared


def test_a_fix_long_after_the_last_one_is_itself():
    sampler, fix = FixSampler(ALL), drawn(7)
    assert sampler.next_sample(fix, TELEMETRY_STEP_S) is sampler.sample(fix)
