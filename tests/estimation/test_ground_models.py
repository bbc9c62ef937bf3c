"""Sloping ground, elevated targets, and a rangefinder's readings in the batch and in the live filter."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from estimated_flights import Planted, flown
from simulated_flight import Flight, path

from fwav_companion.estimation.errors import SampleNoise, priors
from fwav_companion.estimation.ground import LevelGround, TargetPrior
from fwav_companion.estimation.range_readings import SAME_FOOT_M, RangeReading, RangeReadings

TURNS = Flight(seconds=14.0, fps=8.0, shape="turns", height_m=10.0, pitch_deg=0.0, targets=((1.0, 2.0), (-1.5, 1.0)),
               velocities=((0.0, 0.0),) * 2, labels=("", ""))  # fmt: skip
SLOPE = np.array([0.3, -0.2])
KNOWN = priors(camera_delay_s=0.0, mount_rad=0.0, heading_rad=0.0, tilt_rad=0.0, height_m=0.1)


class Hillside:
    """A plane through the origin."""

    def height(self, place):
        return SLOPE @ place, np.repeat(SLOPE[:, None], place.shape[1], 1)


def place_error(planted, estimator, target):
    """Distance of the estimated place from the true one (m), and its squared distance by the claim."""
    answer = estimator.answer(target, planted.flight.seconds - 0.1)
    off = answer.place[:2] - np.array(planted.flight.targets[target])
    return float(np.hypot(*off)), float(off @ np.linalg.solve(answer.covariance[:2, :2], off))


@pytest.fixture(scope="module")
def hillside():
    """A flight over targets on a slope, and its estimator."""
    heights = tuple(float(SLOPE @ np.array(target)) for target in TURNS.targets)
    planted = Planted(TURNS, target_heights_m=heights)
    return planted, flown(planted, KNOWN, ground=Hillside())


def test_target_on_a_slope_is_found_where_the_ray_meets_the_slope(hillside):
    planted, estimator = hillside
    for target in (0, 1):
        error, square = place_error(planted, estimator, target)
        assert error < 0.1
        assert square < 18.0
        up = estimator.answer(target, 13.0).place[2]
        assert up == pytest.approx(planted.target_heights_m[target], abs=0.05)


def test_claim_on_a_slope_is_vertical_where_it_is_horizontal(hillside):
    answer = hillside[1].answer(0, 13.0)
    level = answer.covariance[:2, :2]
    assert answer.covariance[2, 2] == pytest.approx(SLOPE @ level @ SLOPE, abs=2e-6)
    assert answer.covariance[:2, 2] == pytest.approx(level @ SLOPE, rel=0.05, abs=1e-6)


def test_elevated_target_of_known_height_is_found_at_its_foot():
    planted = Planted(TURNS, target_heights_m=(3.0, 0.0))
    roof = {0: TargetPrior(height_m=3.0, height_sigma_m=0.05)}
    assert place_error(planted, flown(planted, KNOWN, targets=roof), 0)[0] < 0.1
    assert place_error(planted, flown(planted, KNOWN), 0)[0] > 0.2


def test_uncertain_height_of_a_target_is_estimated_from_several_sides():
    planted = Planted(TURNS, target_heights_m=(1.0, 0.0))
    estimator = flown(planted, KNOWN, targets={0: TargetPrior(height_sigma_m=2.0)})
    answer = estimator.answer(0, 13.9)
    sigma = float(np.sqrt(answer.covariance[2, 2]))
    assert sigma < 1.0
    assert abs(answer.place[2] - 1.0) < 4.0 * sigma


GROUND_M, ROUGH_GUESS_M = -6.0, -4.5
"""The ground below home, and what a first reading over a bush says of it."""


@cache
def ranged(*, readings=True, trees=0.0):
    """A flight over ground below home, whose rangefinder sees trees of 5 m in a share of the readings."""
    planted = Planted(TURNS, target_heights_m=(GROUND_M, GROUND_M))
    rng = np.random.default_rng(3)

    def observe(estimator, stamp):
        if not readings:
            return
        camera = path(TURNS, np.array([stamp]))[0][0]
        short_m = 5.0 if rng.random() < trees else 0.0
        above_m = -camera[2] - GROUND_M - short_m + 0.03 * rng.standard_normal()
        estimator.add_range(RangeReading(stamp, above_m, 0.03), (camera[0], camera[1]))

    noise = SampleNoise(attitude_rad=planted.attitude_noise, height_wander_m=3.0)
    return planted, flown(planted, KNOWN, noise, ground=LevelGround(ROUGH_GUESS_M), observe=observe)


@pytest.mark.parametrize("trees", [0.0, 0.2])
def test_rangefinder_shows_the_height_above_ground_whose_level_is_not_known(trees):
    _, estimator = ranged(trees=trees)
    live = estimator.live
    up, sigma = live.mean[live.error + 2], float(np.sqrt(live.covariance[live.error + 2, live.error + 2]))
    assert up == pytest.approx(GROUND_M - ROUGH_GUESS_M, abs=0.3)
    assert abs(up - (GROUND_M - ROUGH_GUESS_M)) < 4.0 * sigma
    relative = estimator.answer(0, 13.9).relative
    camera = path(TURNS, np.array([13.9]))[0][0]
    assert relative[:2] == pytest.approx(np.array(TURNS.targets[0]) - camera[:2], abs=0.25)


def test_without_readings_the_height_is_less_certain():
    with_them, without = (ranged(readings=r)[1].live for r in (True, False))
    sigma = [float(np.sqrt(each.covariance[each.error + 2, each.error + 2])) for each in (with_them, without)]
    assert sigma[0] < 0.6 * sigma[1]


def test_reading_between_two_solves_updates_the_live_error():
    estimator = ranged()[1].copy()
    live = estimator.live
    live.covariance[live.error + 2, live.error + 2] += 4.0
    before = live.copy()
    reading, foot = estimator.carrier.ranges.newest(-np.inf, np.inf)
    live.t = reading.t + 1.0
    live.carrier.ranges.append(RangeReading(reading.t + 1.0, reading.height_m + 1.0, 0.03), tuple(foot))
    live._update_by_range()
    assert live.mean[live.error + 2] < before.mean[live.error + 2] - 0.3
    assert live.covariance[live.error + 2, live.error + 2] < before.covariance[live.error + 2, live.error + 2] - 2.0
    assert live.mean[: live.size].tolist() == before.mean[: live.size].tolist()


def readings(times, feet):
    kept = RangeReadings()
    for t, foot in zip(times, feet, strict=True):
        assert kept.append(RangeReading(float(t), 10.0, 0.1), foot)
    return kept


def test_readings_of_one_foot_count_as_one_look_at_the_ground():
    kept = readings([0.1, 0.2, 0.3, 5.1], [(0.0, 0.0), (0.1, 0.0), (0.0, 0.1), (SAME_FOOT_M + 1.0, 0.0)])
    used = kept.used(np.array([0.0, 1.0, 5.0, 6.0]), [], 0.2)
    assert used.variance == pytest.approx([0.01 + 3 * 0.04] * 3 + [0.01 + 0.04])


def test_readings_are_thinned_to_three_between_two_knots():
    times = np.arange(0.0, 4.0, 0.1)
    used = readings(times, [(0.0, 0.0)] * len(times)).used(np.array([0.0, 1.0, 2.0, 4.0]), [], 0.1)
    assert np.histogram(used.t, [0.0, 1.0, 2.0, 4.0])[0].max() <= 4  # the last knot's own reading is in the last gap
    assert len(used.t) >= 7


def test_readings_within_a_break_of_the_path_are_left_out():
    kept = readings([1.0, 1.5, 2.0], [(0.0, 0.0)] * 3)
    used = kept.used(np.array([0.0, 3.0]), [SimpleNamespace(before=1.2, after=1.8)], 0.1)
    assert used.t.tolist() == [1.0, 2.0]


@pytest.mark.parametrize("values", [(np.nan, 0.1), (3.0, np.inf), (3.0, -0.1)])
def test_reading_that_is_not_finite_is_left_out(values):
    assert not RangeReadings().append(RangeReading(1.0, *values), (0.0, 0.0))


def test_snapshot_of_readings_is_not_changed_by_later_ones():
    kept = readings([1.0], [(0.0, 0.0)])
    snapshot = kept.copy()
    kept.append(RangeReading(2.0, 1.0, 0.1), (0.0, 0.0))
    assert (len(snapshot), len(kept)) == (1, 2)
    assert RangeReadings().copy().append(RangeReading(2.0, 1.0, 0.1), (0.0, 0.0))
