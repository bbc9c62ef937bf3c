"""The search for the delay: a steady beat is periodic, and the search does not guess between its periods."""

import msgspec
import numpy as np
import pytest
from draws import first_of
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration import CalibrationStatus
from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.delay_search import ROUNDS, delay_search
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias


def late(delay_s):
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET] = delay_s
    return biases


def hovering(delay_s, flapping_hz, **options):
    shape = {"shape": "hover", "height_m": 10.0, "targets": ((4.0, 3.0),), "seconds": 10.0, "attitude_hz": 100.0}
    return Flight(biases=late(delay_s), flapping_hz=flapping_hz, **shape | options)


def calibrated(flight):
    world = World(flight)
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    for view in world.frames():
        tracker.on_frame(view)
    return tracker.calibration


@pytest.mark.parametrize("seed", first_of(2, 5, 7))
def test_delays_a_beat_apart_are_reported_and_not_guessed_between(seed):
    """A hover at a steady 10 Hz repeats itself every 100 ms, well within the prior; one delay fits better by chance."""
    report = calibrated(hovering(0.03, 10.0, seed=seed))
    assert report.status is CalibrationStatus.AMBIGUOUS
    beats = [round((delay - 0.03) / 0.1) for delay in report.alternatives]
    assert 0 in beats
    assert len(beats) > 1
    assert report.alternatives == pytest.approx([0.03 + 0.1 * beat for beat in beats], abs=0.002)
    assert (report.time_offset_s, report.time_offset_sigma_s) == (0.0, 0.05)
    assert report.mount == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("seed", first_of(1, 2))
def test_what_the_prior_rules_out_is_no_rival(seed):
    """At 5 Hz the other delay is 200 ms away: beyond three sigma of it."""
    report = calibrated(hovering(0.02, 5.0, seed=seed))
    assert report.status is CalibrationStatus.TIME
    assert report.time_offset_s == pytest.approx(0.02, abs=0.002)


def test_turns_tell_beats_apart():
    """With this seed the delay that is wrong by a beat of 100 ms fits the first seconds better."""
    flight = Flight(flapping_hz=10.0, attitude_hz=100.0, seconds=45.0).drawn(5)
    report = calibrated(flight)
    assert report.status is CalibrationStatus.CALIBRATED
    assert abs(report.time_offset_s - flight.biases[Bias.TIME_OFFSET]) < 4 * report.time_offset_sigma_s < 0.002


@pytest.mark.parametrize(("refused", "status"), [(300, CalibrationStatus.UNEXPLAINED), (0, None)])
def test_what_no_delay_explains_is_said_to_be_unexplained(refused, status):
    search = delay_search(CalibrationContext(priors(), World(Flight(seconds=1.0)).state_at))
    trials = search.hypotheses.take(range(0, len(search.hypotheses.score), 2))
    count = len(trials.score)
    trials = msgspec.structs.replace(
        trials, used=np.full(count, 300), refused=np.full(count, refused), score=-20.0 * np.arange(count), frames=300
    )
    result = msgspec.structs.replace(search, hypotheses=trials, round=ROUNDS).result(())
    assert getattr(result, "status", None) is status


def bank(frames, seconds, sights):
    """A search whose bank has seen so many frames and sights within a time."""
    search = delay_search(CalibrationContext(priors(), World(Flight(seconds=1.0)).state_at))
    seen = {"frames": frames, "sights": sights, "first_ns": 10**9, "last_ns": 10**9 + round(seconds * 1e9)}
    return msgspec.structs.replace(search, hypotheses=msgspec.structs.replace(search.hypotheses, **seen))


@pytest.mark.parametrize(
    ("frames", "seconds", "sights", "progress", "begun"),
    [
        (39, 1.3, 78, (39, 40), False),
        (40, 1.3, 40, (40, 40), True),
        (9, 36.0, 15, (15, 16), False),
        (9, 36.0, 17, (17, 16), True),
    ],
)
def test_photographs_are_searched_by_their_sights_and_frames_by_their_number(frames, seconds, sights, progress, begun):
    """A photograph every 4 s has its own telemetry and its own motion; frames at 30/s share both."""
    search = bank(frames, seconds, sights)
    assert (search.progress, search.begun) == (progress, begun)


@pytest.mark.parametrize(("dip", "valley"), [(0.0, False), (6.0, True)])
def test_one_wide_peak_is_no_choice_between_delays(dip, valley):
    """Log-likelihoods over five delays that fall steadily, and with a dip between the last two."""
    search = delay_search(CalibrationContext(priors(), World(Flight(seconds=1.0)).state_at))
    trials = search.hypotheses.take(range(5))
    score = np.array((0.0, -1.0, -2.0, -3.0 - dip, -4.0))
    search = msgspec.structs.replace(search, hypotheses=msgspec.structs.replace(trials, score=score))
    search = msgspec.structs.replace(search, context=CalibrationContext(priors(time_offset=10.0), None))
    assert search._valley(0, 4, range(5)) is valley
