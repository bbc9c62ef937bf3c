"""Self-calibration by the smoother in simulated flights with planted faults."""

import numpy as np
import pytest
from draws import first_of
from simulated_flight import Flight, priors
from simulated_world import World
from smoothed_flights import tracked

from fwav_companion.types import BIAS_COUNT, Bias
from fwav_companion.types.calibration_report import CalibrationStatus, KeptCalibration, SharedParameter

PLANTED = np.zeros(BIAS_COUNT)
PLANTED[Bias.TIME_OFFSET] = 0.035
PLANTED[[Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]] = np.radians([0.5, 1.0, 2.0])
"""Planted mount error, configured against true: the correction is its opposite."""
HOVER = {"shape": "hover", "height_m": 10.0, "targets": ((4.0, 3.0),)}


def flown(flight, *, consider=False):
    """(last state of the oldest confirmed track, tracker) after a flight."""
    best = tracker = None
    for tracker, tracks in tracked(World(flight), consider=consider):  # noqa: B007 - the last one is returned
        for track in tracks:
            if track.confirmed_host_ns is not None and (best is None or track.id == best.id):
                best = track
    return best, tracker


def error_of(track, target):
    return float(np.hypot(*np.subtract(track.position_ned[:2], target)))


@pytest.mark.parametrize("seed", first_of(1, 2))
def test_a_late_camera_and_a_crooked_mount_are_found(seed):
    track, tracker = flown(Flight(seed=seed, biases=PLANTED))
    report = tracker.calibration
    assert report.status is CalibrationStatus.CALIBRATED
    assert error_of(track, (2.0, 3.0)) < 0.06
    assert report.time_offset_s == pytest.approx(0.035, abs=0.003)
    assert np.degrees(report.mount) == pytest.approx(-np.degrees(PLANTED[3:6]), abs=0.3)
    assert abs(report.time_offset_s - 0.035) < 4 * report.time_offset_sigma_s < 0.01


def test_gross_detections_do_not_spoil_it():
    track, tracker = flown(Flight(seed=32, biases=PLANTED, gross=0.05))
    assert error_of(track, (2.0, 3.0)) < 0.06
    assert tracker.calibration.time_offset_s == pytest.approx(0.035, abs=0.003)


def test_where_nothing_is_wrong_nothing_gets_worse():
    errors = []
    for seed in (1, 2):
        flight = Flight(seed=seed, seconds=45, fps=15)
        errors.append([error_of(flown(flight, consider=off)[0], (2.0, 3.0)) for off in (False, True)])
    on, off = np.sqrt(np.mean(np.square(errors), axis=0))
    assert on < 1.1 * off + 0.002


@pytest.mark.parametrize("seed", first_of(1, 4))
def test_a_flight_without_flapping_claims_no_more_than_it_shows(seed):
    """Turns alone show the delay a tenth as well as flapping does: noise of the reported turns must not count as
    turning.
    """
    track, tracker = flown(Flight(seed=seed, flapping_deg=0.0, biases=PLANTED, seconds=45, fps=15))
    report = tracker.calibration
    assert report.status is CalibrationStatus.CALIBRATED
    assert abs(report.time_offset_s - 0.035) < 2 * report.time_offset_sigma_s < 0.012
    assert error_of(track, (2.0, 3.0)) < 0.06


def test_a_mount_off_by_degrees_is_no_gross_mistake():
    _, tracker = flown(Flight(seed=1, fps=10, biases=2 * PLANTED))
    assert tracker.calibration.mistake == ""


def late(delay_s):
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET] = delay_s
    return biases


def hovering(delay_s, flapping_hz, seed):
    return Flight(biases=late(delay_s), flapping_hz=flapping_hz, seed=seed, seconds=10.0, attitude_hz=100.0, **HOVER)


@pytest.mark.parametrize("seed", first_of(1, 2))
def test_what_the_prior_rules_out_is_no_rival(seed):
    """At 5 Hz the other delay is 200 ms away: beyond three sigma of it."""
    _, tracker = flown(hovering(0.02, 5.0, seed))
    assert tracker.calibration.status is CalibrationStatus.TIME
    assert tracker.calibration.time_offset_s == pytest.approx(0.02, abs=0.002)


def test_turns_tell_beats_apart():
    """With this seed the delay that is wrong by a beat of 100 ms fits the first seconds better."""
    flight = Flight(flapping_hz=10.0, attitude_hz=100.0, seconds=45.0).drawn(5)
    report = flown(flight)[1].calibration
    assert report.status is CalibrationStatus.CALIBRATED
    assert abs(report.time_offset_s - flight.biases[Bias.TIME_OFFSET]) < 4 * report.time_offset_sigma_s < 0.002


@pytest.mark.parametrize("slip", [pytest.param({Bias.TIME_OFFSET: 0.06}, id="delay")])
def test_what_slips_in_flight_moves_the_published_place_by_no_more_than_its_claim(slip):
    """The camera is late by another 25 ms once its delay was known.

    A step is judged by the larger of the claims before and after it.
    """
    before, after = PLANTED.copy(), PLANTED.copy()
    for bias, value in slip.items():
        after[bias] = value
    worlds = [World(Flight(seed=2, fps=15, biases=biases)) for biases in (before, after)]
    frames = worlds[0].frames()[:500] + worlds[1].frames()[500:]
    last, statuses = None, []
    for (tracker, tracks), view in zip(tracked(worlds[0], frames), frames, strict=True):
        confirmed = [track for track in tracks if track.confirmed_host_ns is not None]
        if not confirmed:
            continue
        track = min(confirmed, key=lambda each: each.id)
        place, cov = np.array(track.position_ned[:2]), np.array(track.cov)[:2, :2]
        if last is not None and last[0] == track.id:
            step, claim = place - last[1], cov if np.trace(cov) > np.trace(last[2]) else last[2]
            assert step @ np.linalg.solve(claim, step) < 3.0**2, view.frame
        last = (track.id, place, cov)
        statuses.append((view.frame, tracker.calibration.status))
    assert CalibrationStatus.CALIBRATED in [status for frame, status in statuses if frame < 500]


def test_a_kept_calibration_is_where_the_next_flight_starts():
    kept = KeptCalibration(
        time_offset_s=0.035, time_offset_sigma_s=0.001, mount=(-0.01, 0.0, 0.0), mount_sigma=(0.002,) * 3
    )
    tracker, _ = next(iter(tracked(World(Flight(seconds=1.0)), kept=kept)))
    report = tracker.calibration
    assert (report.time_offset_s, report.mount) == (0.035, (-0.01, 0.0, 0.0))
    assert 0.001 < report.time_offset_sigma_s < 0.003


def test_a_mount_far_beyond_its_prior_is_found_and_reported_and_bends_nothing_else():
    biases = late(0.035)
    biases[[Bias.MOUNT_X, Bias.MOUNT_Y]] = np.radians([0.5, 6.0])
    track, tracker = flown(Flight(seed=4, seconds=30, biases=biases, priors=priors(height=0.2)))
    report, error = tracker.calibration, np.subtract(track.position_ned[:2], (2.0, 3.0))
    assert np.degrees(report.mount) == pytest.approx([-0.5, -6.0, 0.0], abs=0.3)
    assert report.height_m == pytest.approx(0.0, abs=0.4)
    assert error @ np.linalg.solve(np.array(track.cov)[:2, :2], error) < 13.8
    assert [each.parameter for each in report.denied] == [SharedParameter.MOUNT_Y]


@pytest.mark.parametrize("seed", first_of(6, 1))
def test_a_heading_that_wanders_within_its_prior_takes_no_claim_along(seed):
    """Its errors are as small as the prior says, and no constant explains them."""
    track, _ = flown(Flight(seed=seed, fps=15, biases=PLANTED, heading_wander=np.radians(2.0)))
    error = np.subtract(track.position_ned[:2], (2.0, 3.0))
    assert error @ np.linalg.solve(np.array(track.cov)[:2, :2], error) < 13.8
