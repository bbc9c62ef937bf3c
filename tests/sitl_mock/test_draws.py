"""Biases are drawn from the given priors by the seed, and each can be set."""

from random import Random

import numpy as np
import pytest

from sitl_mock import scenario
from sitl_mock.draws import SmoothWander, Wander, draw, shifted

SEEDS = range(600)


def drawn(**differences):
    return [draw(scenario("default").but({"seed": seed, **differences})) for seed in SEEDS]


@pytest.mark.parametrize(
    ("bias", "prior"),
    [
        ("attitude_roll_deg", "attitude_bias_deg"),
        ("attitude_pitch_deg", "attitude_bias_deg"),
        ("heading_deg", "heading_bias_deg"),
        ("mount_deg", "mount_bias_deg"),
        ("time_offset_s", "time_offset_sigma_s"),
        ("height_m", "height_bias_m"),
    ],
)
def test_over_seeds_a_bias_has_its_prior_s_spread(bias, prior):
    values = np.array([getattr(one, bias) for one in drawn(**{f"priors.{prior}": 3.0})])
    assert np.std(values) == pytest.approx(3.0, rel=0.12)
    assert abs(np.mean(values)) < 4 * 3.0 / np.sqrt(values.size) + 0.2


def test_an_unknown_readout_is_uniform_over_a_frame_interval():
    values = np.array([one.readout_s for one in drawn(**{"camera.fps": 20.0})])
    assert 0.0 <= values.min() < 0.002
    assert 0.048 < values.max() <= 0.05
    assert np.mean(values) == pytest.approx(0.025, rel=0.1)


def test_setting_one_leaves_the_others():
    base = draw(scenario("default"))
    changed = draw(scenario("default").but({"biases.heading_deg": 0.0}))
    assert changed.heading_deg == 0.0
    assert (changed.mount_deg, changed.time_offset_s, changed.readout_s) == (
        base.mount_deg,
        base.time_offset_s,
        base.readout_s,
    )


def test_none_are_drawn_where_none_are_wanted():
    perfect = draw(scenario("perfect"))
    assert perfect.mount_deg == (0.0, 0.0, 0.0)
    assert (perfect.heading_deg, perfect.time_offset_s, perfect.position_sigma_m, perfect.readout_s) == (0, 0, 0, 0)
    late = draw(scenario("perfect").but({"biases.time_offset_s": 0.035}))
    assert late.time_offset_s == 0.035


def test_a_wander_is_stationary_with_its_time_constant():
    pairs = []
    for seed in range(400):
        wander = Wander(2.0, 60.0, Random(seed))
        pairs.append((wander.at(0.0), wander.at(60.0), wander.at(600.0)))
    start, later, end = np.array(pairs).T
    assert np.std(start) == pytest.approx(2.0, rel=0.12)
    assert np.std(end) == pytest.approx(2.0, rel=0.12)
    assert np.corrcoef(start, later)[0, 1] == pytest.approx(np.exp(-1.0), abs=0.12)


def test_a_wander_can_be_asked_in_any_order():
    one, other = Wander(1.0, 10.0, Random(3)), Wander(1.0, 10.0, Random(3))
    late = one.at(50.0)
    assert other.at(3.3) == one.at(3.3)
    assert other.at(50.0) == late


def test_a_smooth_wander_has_its_variance_its_correlation_and_a_finite_rate():
    # The correlation of two equal lags T in a row is (1 + t / T) exp(-t / T), with T half of the time constant here.
    lags_s = (0.0, 10.0, 30.0, 90.0)
    wanders = [SmoothWander(2.0, 60.0, Random(seed)) for seed in range(600)]
    values = np.array([[wander.at(100.0 + lag_s) for lag_s in lags_s] for wander in wanders])
    assert np.std(values) == pytest.approx(2.0, rel=0.08)
    for column, lag_s in enumerate(lags_s):
        true = (1.0 + lag_s / 30.0) * np.exp(-lag_s / 30.0)
        assert np.mean(values[:, 0] * values[:, column]) / 4.0 == pytest.approx(true, abs=0.15)
    steps = np.array([wander.at(50.001) - wander.at(50.0) for wander in wanders]) / 0.001
    # The RMS rate is sigma / T; that of a first-order error is infinite.
    assert np.std(steps) == pytest.approx(2.0 / 30.0, rel=0.12)


def test_a_shift_of_the_position_is_complete_after_its_time():
    shifts = ((50.0, 58.0, 0.32, -0.24),)
    assert shifted(shifts, 49.9) == (0.0, 0.0)
    assert shifted(shifts, 54.0) == pytest.approx((0.16, -0.12))
    assert shifted(shifts, 60.0) == pytest.approx((0.32, -0.24))


def test_an_unknown_option_names_the_nearest():
    with pytest.raises(KeyError, match="height_m"):
        scenario("default").but({"flight.heigth_m": 3.0})
    with pytest.raises(KeyError, match="walker"):
        scenario("nonsense")
