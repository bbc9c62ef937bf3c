"""Sightings of a whole flight: bounded, evenly spread, renamed; and the places by all of them."""

import numpy as np
import pytest
from estimated_flights import Planted
from simulated_flight import Flight

from fwav_companion.estimation.errors import SampleNoise, priors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.whole_flight import MOST_KNOTS, MOST_TARGETS, WholeFlight, even_knots


def frame(number, targets=(1,)):
    """A frame at its number in seconds."""
    count = len(targets)
    return Sightings(
        np.full(count, float(number)), np.zeros((3, count)), np.zeros((2, 3, count)),
        np.full(count, number, np.int64), np.array(targets, np.int64), np.zeros(count),
    )  # fmt: skip


def kept(most, frames):
    whole = WholeFlight(most)
    for each in frames:
        whole.add(each)
    return whole.sightings(-1.0)


def test_all_sightings_are_kept_up_to_the_bound_and_never_more():
    for count in (1, 99, 100, 101, 250, 1000):
        s = kept(100, [frame(k) for k in range(count)])
        assert len(s) == min(count, len(s))
        assert len(s) <= 100
        assert len(s) >= min(count, 50)


def test_kept_frames_are_evenly_spread_over_the_flight():
    s = kept(100, [frame(k) for k in range(1000)])
    assert set(np.diff(s.t)) == {16.0}
    assert (s.t[0], s.t[-1]) == (0.0, 992.0)


def test_frames_stay_whole():
    s = kept(100, [frame(k, (1, 2, 3)) for k in range(200)])
    assert set(np.unique(s.frame, return_counts=True)[1]) == {3}


def test_sightings_of_merged_targets_count_for_the_last_name_and_are_in_order():
    whole = WholeFlight()
    for each in (frame(5, (3,)), frame(2, (1,)), frame(7, (2,))):
        whole.add(each)
    whole.rename(1, 2)
    whole.rename(2, 3)
    whole.add(frame(6, (2,)))  # a later target may have the number of one that was merged
    s = whole.sightings(2.5)
    assert s.target.tolist() == [3, 2, 3]
    assert s.t.tolist() == [5.0, 6.0, 7.0]
    assert whole.sightings(7.0) is None


def test_forgotten_target_is_left_out_of_frames_that_show_others():
    whole = WholeFlight()
    for each in (frame(1, (1, 2)), frame(2, (1,)), frame(3, (2,))):
        whole.add(each)
    whole.forget(1)
    s = whole.sightings(-1.0)
    assert s.target.tolist() == [2, 2]
    assert s.t.tolist() == [1.0, 3.0]


def test_only_the_targets_that_are_seen_most_are_solved():
    many = [frame(k, tuple(range(MOST_TARGETS + 10))) for k in range(3)] + [frame(9, (MOST_TARGETS + 9,))]
    ids = np.unique(kept(10**6, many).target)
    assert len(ids) == MOST_TARGETS
    assert MOST_TARGETS + 9 in ids


def test_snapshot_does_not_take_later_frames():
    whole = WholeFlight()
    whole.add(frame(1))
    before = whole.copy()
    whole.add(frame(2))
    assert len(before.sightings(-1.0)) == 1


@pytest.mark.parametrize("span_s", [0.1, 30.0, 600.0, 7200.0])
def test_knots_are_few_cover_all_sightings_and_both_sides_of_a_break(span_s):
    t = np.linspace(100.0, 100.0 + span_s, 500)
    end, inside = float(t[-1]), [100.0 + 0.4 * span_s, 100.0 + 0.41 * span_s]
    knots = even_knots(t, end, inside)
    assert 2 <= len(knots) <= MOST_KNOTS + 5
    assert knots[0] <= t[0]
    assert knots[-1] == end
    assert (np.diff(knots) > 0).all()
    assert np.isin(np.round(inside, 6), knots).all()


def test_places_by_the_whole_flight_are_within_their_claims_and_use_early_sightings():
    """A target that is in view at the flight's beginning alone, before the calibration is known."""
    flight = Flight(seconds=16.0, fps=6.0, shape="turns", height_m=10.0, pitch_deg=0.0,
                    targets=((1.0, 2.0), (-1.5, 1.0)), velocities=((0.0, 0.0),) * 2, labels=("", ""))  # fmt: skip
    planted = Planted(flight, np.array([0.035, 0.02, -0.01, 0.015, 0.03, 0, 0, 0.3, 0, 0, 0, 0, 0]))
    estimator = Estimator(priors(), SampleNoise(attitude_rad=planted.attitude_noise), whole_flight=WholeFlight())
    attitudes, positions = planted.telemetry()
    events = [(t + 0.05, 0, sample) for sample in attitudes for t in sample[:1]]
    events += [(t + 0.05, 1, sample) for sample in positions for t in sample[:1]]
    events += [(t + 0.25, 2, (t, s)) for t, s in planted.frames()]
    for _, kind, value in sorted(events, key=lambda event: event[:2]):
        if kind < 2:
            (estimator.add_attitude, estimator.add_position)[kind](*value)
            continue
        t, s = value
        estimator.update(s if t < 6.0 else s.select(s.target == 0))
        if estimator.is_solve_due(float(t)):
            estimator.solve(float(t))
    final = estimator.final_places()
    assert set(final) == {0, 1}
    for target, place in final.items():
        off = np.array([place.north, place.east]) - flight.targets[target]
        assert off @ np.linalg.solve(np.array(place.cov), off) < 18.0
        assert np.hypot(*off) < 0.2
    assert final[1].sightings < final[0].sightings


def test_no_place_before_the_first_solve_and_none_without_a_whole_flight():
    assert Estimator(priors(), SampleNoise(), whole_flight=WholeFlight()).final_places() == {}
    assert Estimator(priors(), SampleNoise()).final_places() == {}
