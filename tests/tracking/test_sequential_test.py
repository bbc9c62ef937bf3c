"""The score of a track and the rates of the detector, by the formulas of a sequential test and of conjugate priors."""

from functools import partial
from math import log

import pytest
from handmade import host_ns
from scipy.stats import beta, gamma

from fwav_companion.tracking.detector_model import (
    DETECTED_PRIOR,
    FALSE_PRIOR,
    FRAMES_PRIOR,
    MISSED_PRIOR,
    DetectorModel,
)
from fwav_companion.tracking.lifecycle import Life, deleted, detected, initiated, not_detected
from fwav_companion.types import Reason, TrackState

SEEN = DetectorModel(detected=60.0, looks=80.0, false=30.0, frames=100.0, seconds=10.0, last_ns=host_ns(0.0),
                     detection_probability=0.75)  # fmt: skip
"""A detector at 10 Hz that finds three of four."""


def of_track(detections, looks):
    """Ten looks at the flight's probability, and the track's own."""
    return (10.0 * 0.75 + detections) / (10.0 + looks)


def test_a_detection_adds_its_likelihood_ratio_and_the_probability_to_be_detected():
    life = detected(initiated(host_ns(0.0)), host_ns(0.1), 2.5, SEEN)
    assert life.log_likelihood_ratio == pytest.approx(2.5 + log(of_track(1, 1)))
    assert (life.detections, life.looks, life.misses) == (2, 2, 0)
    assert (life.first_ns, life.last_seen_ns) == (host_ns(0.0), host_ns(0.1))
    again = detected(life, host_ns(0.2), -1.0, SEEN)
    assert again.log_likelihood_ratio == pytest.approx(2.5 + log(of_track(1, 1)) - 1.0 + log(of_track(2, 2)))


def test_three_detections_and_the_threshold_confirm_and_it_stays_confirmed():
    one = initiated(host_ns(0.0))
    two = detected(one, host_ns(0.1), 50.0, SEEN)
    assert (two.state, two.confirmed_ns) == (TrackState.TENTATIVE, None)
    three = detected(two, host_ns(0.2), 0.0, SEEN)
    assert (three.state, three.confirmed_ns) == (TrackState.CONFIRMED, host_ns(0.2))
    weak = detected(detected(detected(one, host_ns(0.1), 0.1, SEEN), host_ns(0.2), 0.1, SEEN), host_ns(0.3), 0.1, SEEN)
    assert weak.state is TrackState.TENTATIVE
    missed = not_detected(three, host_ns(0.3), missed=True, moving=False, detector=SEEN)
    assert detected(missed, host_ns(0.4), -9.0, SEEN).confirmed_ns == host_ns(0.2)


def test_a_missed_look_counts_whole_for_a_tentative_track_and_by_its_time_for_a_confirmed_one():
    tentative = initiated(host_ns(0.0))
    after = not_detected(tentative, host_ns(0.1), missed=True, moving=False, detector=SEEN)
    assert after.log_likelihood_ratio == pytest.approx(log(1.0 - of_track(1, 1)))
    assert (after.looks, after.misses, after.state) == (2, 1, TrackState.TENTATIVE)
    confirmed = Life(TrackState.CONFIRMED, host_ns(-9.0), host_ns(0.0), 20.0, 30, 40, confirmed_ns=host_ns(-8.0))
    after = not_detected(confirmed, host_ns(0.1), missed=True, moving=False, detector=SEEN)
    half = 0.1 / 0.2
    assert after.log_likelihood_ratio == pytest.approx(20.0 + half * log(1.0 - of_track(30, 40)))
    moving = not_detected(confirmed, host_ns(0.1), missed=True, moving=True, detector=SEEN)
    assert moving.log_likelihood_ratio == pytest.approx(20.0 + half / 2.0 * log(1.0 - of_track(30, 40)))
    later = not_detected(after, host_ns(1.0), missed=True, moving=False, detector=SEEN)
    assert later.log_likelihood_ratio == pytest.approx(after.log_likelihood_ratio + log(1.0 - of_track(30, 40)))
    assert (later.looks, later.misses) == (42, 2)


def test_misses_since_the_last_detection_do_not_lower_its_own_probability():
    """A target that has left is no evidence that the detector misses more."""
    missed = Life(TrackState.CONFIRMED, host_ns(-9.0), host_ns(0.0), 20.0, 30, 45, 5, host_ns(-8.0))
    after = not_detected(missed, host_ns(1.0), missed=True, moving=False, detector=SEEN)
    assert after.log_likelihood_ratio == pytest.approx(20.0 + log(1.0 - of_track(30, 40)))


def test_a_frame_that_did_not_look_changes_nothing_but_by_its_time():
    life = Life(TrackState.CONFIRMED, host_ns(-9.0), host_ns(0.0), 20.0, 30, 40, confirmed_ns=host_ns(-8.0))
    quiet = partial(not_detected, missed=False, moving=False, detector=SEEN)
    assert quiet(life, host_ns(0.25)) is life
    coasting = quiet(life, host_ns(0.26))
    assert (coasting.state, coasting.log_likelihood_ratio, coasting.looks) == (TrackState.COASTING, 20.0, 40)
    assert quiet(life, host_ns(300.0)).state is TrackState.COASTING
    ended = quiet(life, host_ns(300.1))
    assert (ended.state, ended.reason) == (TrackState.DROPPED, Reason.NOT_SEEN_LONG)
    assert quiet(life, host_ns(10.0), moving=True).state is TrackState.COASTING
    assert quiet(life, host_ns(10.1), moving=True).reason is Reason.NOT_SEEN_LONG


def test_a_tentative_track_out_of_view_waits_for_thirty_frames_or_two_seconds_and_no_longer_than_a_track_is_kept():
    life, slow = initiated(host_ns(0.0)), DetectorModel(frames=9.0, seconds=9.0, last_ns=host_ns(0.0))
    quiet = partial(not_detected, life, missed=False, moving=False, detector=SEEN)
    assert quiet(host_ns(2.9)).state is TrackState.TENTATIVE  # the frame interval is that of all frames, 0.1 s and more
    assert quiet(host_ns(9.0)).reason is Reason.NEVER_CONFIRMED
    at_1_hz = partial(not_detected, life, missed=False, detector=slow)
    assert at_1_hz(host_ns(20.0), moving=False).state is TrackState.TENTATIVE
    assert at_1_hz(host_ns(10.0), moving=True).state is TrackState.TENTATIVE
    assert at_1_hz(host_ns(10.1), moving=True).reason is Reason.NEVER_CONFIRMED


def test_a_track_that_was_detected_often_lasts_fifteen_looks_and_no_more():
    life = initiated(host_ns(0.0))
    for k in range(1, 400):
        life = detected(life, host_ns(0.1 * k), 5.0, SEEN)
    slow = DetectorModel(frames=99.0, seconds=99.0, last_ns=host_ns(40.0), detection_probability=0.75)
    looks = 0
    while life.state is not TrackState.DROPPED:
        life = not_detected(life, host_ns(41.0 + looks), missed=True, moving=False, detector=slow)
        looks += 1
    assert (looks, life.reason) == (15, Reason.NOT_SEEN)


def test_a_life_that_is_ended_from_outside_has_that_reason():
    ended = deleted(initiated(host_ns(0.0)), Reason.ORIGIN_SET)
    assert (ended.state, ended.reason) == (TrackState.DROPPED, Reason.ORIGIN_SET)


def test_the_rates_are_the_means_of_their_posteriors():
    model = DetectorModel(last_ns=host_ns(0.0))
    for k in range(1, 101):
        model = model.after_frame(host_ns(0.1 * k), detected=k % 4 != 0, looks=1, false=int(k % 10 == 0))
    posterior = beta(DETECTED_PRIOR + 75, MISSED_PRIOR + 25)
    assert model.detection_probability == pytest.approx(posterior.mean())
    assert model.false_per_frame == pytest.approx(gamma(FALSE_PRIOR + 10, scale=1.0 / (FRAMES_PRIOR + 100)).mean())
    assert model.frames_hz == pytest.approx(10.0)
    assert model.elapsed_s(host_ns(10.5)) == pytest.approx(0.5)
    assert model.interval_s(host_ns(10.5)) == pytest.approx(10.5 / 101)
    assert model.last_ns == host_ns(10.0)


def test_before_twenty_frames_false_detections_may_only_exceed_the_prior():
    clean, dirty = DetectorModel(frames=19.0), DetectorModel(frames=19.0, false=12.0)
    assert clean.false_per_frame == pytest.approx(0.1)
    assert dirty.false_per_frame == pytest.approx(12.5 / 24.0)
    assert DetectorModel(frames=20.0).false_per_frame == pytest.approx(0.03)  # 0.5 / 25 is below the bound
    assert DetectorModel(frames=1000.0).false_per_frame == pytest.approx(0.03)


def test_the_memory_is_a_thousand_looks_and_frames():
    model = DetectorModel(
        detected=900.0, looks=1000.0, false=100.0, frames=1000.0, seconds=50.0, last_ns=host_ns(0.0)
    ).after_frame(host_ns(1.0), detected=1, looks=1, false=1)
    halves = (450.5, 500.5, 50.5, 500.5, 25.5)
    assert (model.detected, model.looks, model.false, model.frames, model.seconds) == pytest.approx(halves)
    assert model.detection_probability == pytest.approx((DETECTED_PRIOR + 450.5) / (5.0 + 500.5))


@pytest.mark.parametrize(("detections", "bound"), [(500, 0.95), (0, 0.05)])
def test_no_detector_is_perfect_and_none_is_blind(detections, bound):
    model = DetectorModel(detected=float(detections), looks=500.0, last_ns=host_ns(0.0))
    assert model.after_frame(host_ns(1.0), detected=0, looks=0, false=0).detection_probability == bound


def test_the_threshold_makes_one_false_track_in_ten_hours():
    """Chains of clutter exceed t with a probability of exp(-t) at most, and as many begin as false detections come."""
    an_hour = 3600.0 * 10.0 * SEEN.false_per_frame
    assert an_hour * 2.718281828459045 ** (-SEEN.confirming_llr("")) == pytest.approx(0.1)
    seldom = DetectorModel(frames=100.0, seconds=1_000_000.0)
    assert seldom.confirming_llr("") == 5.0, "odds of 150 to one at least"
    assert DetectorModel().frames_hz == pytest.approx(30.0)
