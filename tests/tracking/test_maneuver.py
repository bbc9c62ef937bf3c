"""The running mean of the manoeuvre detector: under noise, under a wing beat, and in a turn."""

import numpy as np
import pytest
from handmade import a_fix, host_ns
from simulated_flight import priors

from fwav_companion.tracking.filters.maneuver import JUMPED, MEAN_VARIANCE, MOST_NIS, TURNED, ManeuverLag
from fwav_companion.tracking.filters.moving import ACCELERATION_DENSITY, UNSEEN_DENSITY, MovingKalman

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, height_noise_m=0.0)
SIGMA_M = 0.2
EXPECTED = (SIGMA_M**2, 0.0, SIGMA_M**2)
DT_S = 1.0 / 30.0


def run(offsets):
    lag, lags = ManeuverLag(), []
    for north, east in offsets:
        lag = lag.with_fix(north, east, DT_S)
        lags.append(lag)
    return lags


def test_of_noise_it_is_as_small_as_it_claims_and_no_turn():
    lags = run(np.random.default_rng(2).normal(0.0, SIGMA_M, (20_000, 2)).tolist())[100:]
    assert np.var([lag.north_m for lag in lags]) == pytest.approx(MEAN_VARIANCE * SIGMA_M**2, rel=0.1)
    assert sum(lag.is_turn(EXPECTED, JUMPED) for lag in lags) <= 5
    assert np.mean([lag.is_turn(EXPECTED, TURNED) for lag in lags]) == pytest.approx(np.exp(-0.5 * TURNED), rel=0.3)
    assert lags[-1].back_s == pytest.approx(DT_S * 0.85 / 0.15)


@pytest.mark.parametrize("beat_hz", [5.0, 8.0, 12.0])
def test_a_beat_that_throws_fixes_forth_and_back_is_no_turn(beat_hz):
    t = np.arange(600) * DT_S
    thrown = 0.6 * np.sin(2.0 * np.pi * beat_hz * t)
    expected = (SIGMA_M**2 + 0.5 * 0.6**2, 0.0, SIGMA_M**2)
    assert not any(lag.is_turn(expected, TURNED) for lag in run(np.stack([thrown, 0.0 * t], -1).tolist())[5:])


def test_fixes_that_all_lie_on_one_side_are_a_turn():
    assert run([(0.1 * k, 0.0) for k in range(12)])[-1].is_turn(EXPECTED, JUMPED)


def test_one_fix_however_far_is_no_turn_and_two_are():
    """30 sigma off: unclipped, the first one alone would free the target to follow a false detection."""
    first = ManeuverLag().with_clipped(30.0 * SIGMA_M, 0.0, DT_S, EXPECTED)
    assert not first.is_turn(EXPECTED, TURNED)
    assert ManeuverLag().with_fix(30.0 * SIGMA_M, 0.0, DT_S).is_turn(EXPECTED, TURNED)
    assert first.with_clipped(30.0 * SIGMA_M, 0.0, DT_S, EXPECTED).is_turn(EXPECTED, TURNED)


def test_an_innovation_within_four_sigma_counts_whole():
    near = ManeuverLag().with_clipped(4.6 * SIGMA_M, 0.0, DT_S, EXPECTED)
    assert near == ManeuverLag().with_fix(4.6 * SIGMA_M, 0.0, DT_S)
    tilted = (SIGMA_M**2, 0.9 * SIGMA_M**2, SIGMA_M**2)
    across = ManeuverLag().with_clipped(4.0 * SIGMA_M, -4.0 * SIGMA_M, DT_S, tilted)
    assert across.north_m == pytest.approx(0.15 * 4.0 * SIGMA_M * np.sqrt(MOST_NIS / 320.0))


def test_a_filter_catches_up_with_a_target_that_turned_about_within_half_a_second():
    rng = np.random.default_rng(3)
    belief = None
    for k in range(1, 165):
        t = k * DT_S
        north = 1.5 * min(t, 5.0) - 1.5 * max(0.0, t - 5.0)
        place = (north + SIGMA_M * rng.standard_normal(), SIGMA_M * rng.standard_normal(), 0.0)
        fix = a_fix(t, place, np.diag([SIGMA_M**2, SIGMA_M**2, 0.0]))
        belief = MovingKalman(NO_BIAS).initiate(fix) if belief is None else belief.predict(host_ns(t)).update(fix)
    assert t == pytest.approx(5.47, abs=0.01)
    assert belief.velocity_ned[0] == pytest.approx(-1.5, abs=0.8)
    assert belief.position_ned[0] == pytest.approx(north, abs=0.35)


def test_a_target_that_is_not_seen_may_go_anywhere():
    belief = MovingKalman(NO_BIAS).initiate(a_fix(0.0, (0.0, 0.0, 0.0)))
    known = belief.velocity_cov[0][0]
    soon, late = belief.predict(host_ns(0.5)), belief.predict(host_ns(0.5)).predict(host_ns(9.5))
    assert soon.velocity_cov[0][0] - known == pytest.approx(0.5 * ACCELERATION_DENSITY)
    assert late.velocity_cov[0][0] - soon.velocity_cov[0][0] == pytest.approx(9.0 * UNSEEN_DENSITY)
