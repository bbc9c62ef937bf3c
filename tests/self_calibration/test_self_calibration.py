"""Self-calibration in simulated flights with planted faults."""

import numpy as np
import pytest
import simulated_world
from draws import first_of
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration import CalibrationStatus, KeptCalibration
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias, Reason

PLANTED = np.zeros(BIAS_COUNT)
PLANTED[Bias.TIME_OFFSET] = 0.035
PLANTED[[Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]] = np.radians([0.5, 1.0, 2.0])
"""Planted mount error, configured against true: the correction is its opposite."""


def flown(flight, **options):
    """(last state of the oldest confirmed track, calibration) after a flight."""
    world, best = World(flight), None
    options = {"self_calibration": True, **options}
    tracker = make_tracker(TrackingOptions(**options), flight.priors, world.state_at)
    for view in world.frames():
        for track in tracker.on_frame(view):
            if track.confirmed_host_ns is not None and (best is None or track.id == best.id):
                best = track
    return best, tracker.calibration


def error_of(track, target):
    return float(np.hypot(*np.subtract(track.position_ned[:2], target)))


@pytest.mark.parametrize("seed", first_of(1, 2))
def test_a_late_camera_and_a_crooked_mount_are_found(seed):
    flight = Flight(seed=seed, biases=PLANTED)
    track, report = flown(flight)
    assert report.status is CalibrationStatus.CALIBRATED
    assert error_of(track, (2.0, 3.0)) < 0.06
    assert report.time_offset_s == pytest.approx(0.035, abs=0.003)
    assert np.degrees(report.mount) == pytest.approx(-np.degrees(PLANTED[3:6]), abs=0.3)
    assert abs(report.time_offset_s - 0.035) < 4 * report.time_offset_sigma_s < 0.01


def test_gross_detections_do_not_spoil_it():
    track, report = flown(Flight(seed=32, biases=PLANTED, gross=0.05))
    assert error_of(track, (2.0, 3.0)) < 0.06
    assert report.time_offset_s == pytest.approx(0.035, abs=0.003)


def test_where_nothing_is_wrong_nothing_gets_worse():
    ratio = []
    for seed in (1, 2):
        flight = Flight(seed=seed, seconds=45)
        ratio.append([error_of(flown(flight, self_calibration=on)[0], (2.0, 3.0)) for on in (True, False)])
    on, off = np.sqrt(np.mean(np.square(ratio), axis=0))
    assert on < 1.1 * off + 0.002


def test_a_hover_leaves_the_mount_alone():
    flight = Flight(seed=6, seconds=20, fps=15, shape="hover", height_m=10.0, targets=((4.0, 3.0),))
    track, report = flown(flight)
    assert report.status is CalibrationStatus.TIME
    assert report.mount == (0.0, 0.0, 0.0)
    assert report.mount_sigma == pytest.approx(np.radians([1, 1, 1]))
    assert report.time_offset_s == pytest.approx(0.0, abs=0.002)
    assert error_of(track, (4.0, 3.0)) < 0.02
    assert np.sqrt(track.cov[0][0]) > 0.15  # the mount's prior is still in it


def test_what_does_not_shake_shows_no_delay():
    flight = Flight(seed=6, seconds=20, fps=15, shape="hover", height_m=10.0, targets=((4.0, 3.0),), flapping_deg=0.0)
    track, report = flown(flight)
    assert report.status is CalibrationStatus.WAITING
    assert report.time_offset_sigma_s == 0.05
    assert error_of(track, (4.0, 3.0)) < 0.03


@pytest.mark.parametrize("seed", first_of(1, 4))
def test_a_flight_without_flapping_claims_no_more_than_it_shows(seed):
    """Turns alone show the delay a tenth as well as flapping does: noise of the reported turns must not count as
    turning.
    """
    track, report = flown(Flight(seed=seed, flapping_deg=0.0, biases=PLANTED, seconds=45, fps=15))
    assert report.status is CalibrationStatus.CALIBRATED
    assert abs(report.time_offset_s - 0.035) < 2 * report.time_offset_sigma_s < 0.012
    assert error_of(track, (2.0, 3.0)) < 0.06


@pytest.mark.parametrize("late_by", first_of(0.00125, -0.00125))
def test_attitudes_that_are_all_as_late_are_no_delay_of_the_camera(late_by):
    """They look like a camera delay, and make no target worse: the delay is covered even at the end of what stamps
    leave open.
    """
    track, report = flown(Flight(seed=3, biases=PLANTED, late_by=late_by, seconds=45))
    assert report.time_offset_s + late_by == pytest.approx(0.035, abs=0.0008)
    assert abs(report.time_offset_s - 0.035) < 3 * report.time_offset_sigma_s < 0.002
    assert report.keep.time_offset_sigma_s == report.time_offset_sigma_s
    assert error_of(track, (2.0, 3.0)) < 0.06


@pytest.mark.parametrize(
    ("open_s", "status"), [(0.01, CalibrationStatus.CALIBRATED), (0.02, CalibrationStatus.WAITING)]
)
def test_attitudes_whose_instant_is_open_teach_nothing(open_s, status):
    """For example with two attitudes a beat: any delay fits them."""
    flight = Flight(seed=3, biases=PLANTED, late_by=0.0, stamp_late_s=open_s * np.sqrt(12.0), seconds=45)
    track, report = flown(flight)
    assert report.status is status
    assert report.time_offset_sigma_s >= open_s / 2
    assert track.confirmed_host_ns is not None


def test_a_kept_calibration_is_where_the_next_flight_starts():
    p = priors()
    kept = KeptCalibration(
        time_offset_s=0.035, time_offset_sigma_s=0.001, mount=(-0.01, 0.0, 0.0), mount_sigma=(0.002,) * 3
    )
    report = make_tracker(TrackingOptions(self_calibration=True), p, None, kept).calibration
    assert (report.time_offset_s, report.time_offset_sigma_s, report.mount) == (0.035, 0.001, (-0.01, 0.0, 0.0))
    assert report.status is CalibrationStatus.WAITING


def test_without_the_vehicles_history_it_still_runs():
    flight = Flight(seconds=15, shape="hover", height_m=10.0, targets=((4.0, 3.0),))
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors)
    for view in World(flight).frames():
        tracks = tracker.on_frame(view)
    assert error_of(tracks[0], (4.0, 3.0)) < 0.05


TURNS = {
    "upside down": (-1, 0, 0, -1),
    "90 degrees clockwise": (0, -1, 1, 0),
    "90 degrees counterclockwise": (0, 1, -1, 0),
    "left to right": (-1, 0, 0, 1),
    "top to bottom": (1, 0, 0, -1),
}


def turned_flight(monkeypatch, a, b, c, d):
    """A flight whose image is turned about its middle: pixel x' = a x + b y, y' = c x + d y."""
    straight = simulated_world.pixel_from_camera

    def turned(points):
        x, y = (straight(points) - (320, 240)).T
        return np.stack([320 + a * x + b * y, 240 + c * x + d * y], -1)

    flight = Flight(fps=10)
    world = World(flight)
    monkeypatch.setattr(simulated_world, "pixel_from_camera", turned)
    return flight, world, world.frames()


@pytest.mark.parametrize("name", first_of(*TURNS, few=2))
def test_a_gross_mistake_is_named_and_nothing_is_estimated(name, monkeypatch):
    flight, world, views = turned_flight(monkeypatch, *TURNS[name])
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    for view in views:
        tracker.on_frame(view)
    assert name in tracker.calibration.mistake
    assert tracker.calibration.status is CalibrationStatus.WAITING


def test_a_mount_off_by_degrees_is_no_gross_mistake(monkeypatch):
    flight, world, views = turned_flight(monkeypatch, 1, 0, 0, 1)
    flight.biases[:] = 2 * PLANTED
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    for view in views:
        tracker.on_frame(view)
    assert tracker.calibration.mistake == ""


def test_what_was_learnt_outlives_the_tracks():
    flight = Flight(seed=1, biases=PLANTED, seconds=45)
    world = World(flight)
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    for view in world.frames():
        tracker.on_frame(view)
    reported, keep = tracker.calibration, tracker.calibration.keep
    tracker.drop_all(Reason.ORIGIN_SET, view)
    report = tracker.calibration
    assert report.time_offset_s == keep.time_offset_s == pytest.approx(0.035, abs=0.003)
    assert report.mount == keep.mount
    assert (
        report.mount_sigma[2] > 2.0 * reported.mount_sigma[2]
    )  # as far as heading and mount are one, another flight's differ
    assert np.all(np.abs(report.mount + PLANTED[3:6]) < 3.0 * np.array(report.mount_sigma))
