"""Self-calibration by the smoother in simulated flights with planted faults."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from draws import first_of
from simulated_flight import Flight
from simulated_world import World
from smoothed_flights import tracked

from fwav_companion.types import BIAS_COUNT, Bias
from fwav_companion.types.calibration_report import CalibrationStatus, KeptCalibration

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


@cache
def slipped(bias, value):
    """[(frame, track, place, covariance, status)] of the oldest confirmed track after each frame of a flight whose bias
    changes after 500 frames.
    """
    before, after = PLANTED.copy(), PLANTED.copy()
    after[bias] = value
    worlds = [World(Flight(seed=2, fps=15, biases=biases)) for biases in (before, after)]
    frames = worlds[0].frames()[:500] + worlds[1].frames()[500:]
    seen = []
    for (tracker, tracks), view in zip(tracked(worlds[0], frames), frames, strict=True):
        confirmed = [track for track in tracks if track.confirmed_host_ns is not None]
        if confirmed:
            track = min(confirmed, key=lambda each: each.id)
            place, cov = np.array(track.position_ned[:2]), np.array(track.cov)[:2, :2]
            seen.append((view.frame, track.id, place, cov, tracker.calibration.status))
    return seen


CALIBRATED = CalibrationStatus.CALIBRATED
SLIPS = {"mount": (Bias.MOUNT_Y, np.radians(3.0)), "delay": (Bias.TIME_OFFSET, 0.06)}
"""The mount slips by 2 degrees, or the camera is late by another 25 ms, once both were known."""
AVERAGED = pytest.mark.xfail(
    strict=True,
    reason="the mount before and after the slip is averaged: -2.04 degrees about y for -3 with a sigma of 0.05, "
    "calibrated throughout; the place is off by 0.17 m with a sigma of 0.025 m, and then jumps by 4.8 sigmas",
)


@pytest.mark.parametrize("slip", [pytest.param("mount", marks=AVERAGED), "delay"])
def test_what_slips_in_flight_moves_the_published_place_by_no_more_than_its_claim(slip):
    """A step is judged by the larger of the claims before and after it."""
    seen = slipped(*SLIPS[slip])
    assert CALIBRATED in [status for frame, *_, status in seen if frame < 500]
    for (_, track, place, cov, _), (frame, now, there, wider, _) in pairwise(seen):
        if track == now:
            step, claim = there - place, wider if np.trace(wider) > np.trace(cov) else cov
            assert step @ np.linalg.solve(claim, step) < 3.0**2, frame


@AVERAGED
def test_a_mount_that_slips_in_flight_is_no_longer_calibrated():
    assert slipped(*SLIPS["mount"])[-1][-1] is not CALIBRATED


def test_a_kept_calibration_is_where_the_next_flight_starts():
    kept = KeptCalibration(
        time_offset_s=0.035, time_offset_sigma_s=0.001, mount=(-0.01, 0.0, 0.0), mount_sigma=(0.002,) * 3
    )
    tracker, _ = next(iter(tracked(World(Flight(seconds=1.0)), kept=kept)))
    report = tracker.calibration
    assert (report.time_offset_s, report.mount) == (0.035, (-0.01, 0.0, 0.0))
    assert 0.001 < report.time_offset_sigma_s < 0.003


CONSTANT = pytest.mark.xfail(
    strict=True,
    reason="a heading that wanders by 2 degrees within 20 s is fitted by a constant: the place is off by 0.40 m with a "
    "sigma of 0.02 m, a square of 540 where 13.8 is the limit",
)


@pytest.mark.parametrize("seed", [6, pytest.param(1, marks=[pytest.mark.slow, CONSTANT])])
def test_a_heading_that_wanders_within_its_prior_takes_no_claim_along(seed):
    """Its errors are as small as the prior says, and no constant explains them."""
    track, _ = flown(Flight(seed=seed, fps=15, biases=PLANTED, heading_wander=np.radians(2.0)))
    error = np.subtract(track.position_ned[:2], (2.0, 3.0))
    assert error @ np.linalg.solve(np.array(track.cov)[:2, :2], error) < 13.8
