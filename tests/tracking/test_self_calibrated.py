"""Self-calibration together with filters that it does not correct: the paper's, and that of targets which may move."""

import msgspec
import numpy as np
import pytest
from handmade import a_fix, a_view
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration import CalibrationStatus
from fwav_companion.self_calibration.filter_pass import FIRST_MEASUREMENTS
from fwav_companion.tracking import TrackingOptions, make_tracker, tracker_with
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.types import BIAS_COUNT, Bias, TrackState

PLANTED = np.zeros(BIAS_COUNT)
PLANTED[Bias.TIME_OFFSET] = 0.035
PLANTED[[Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]] = np.radians([0.5, 1.0, 2.0])


def flown(flight, **options):
    """(tracks of each frame, calibration)."""
    world = World(flight)
    tracker = make_tracker(TrackingOptions(**options), flight.priors, world.state_at)
    return [tracker.on_frame(view) for view in world.frames()], tracker.calibration


def is_found(report):
    assert report.status is CalibrationStatus.CALIBRATED
    assert report.time_offset_s == pytest.approx(0.035, abs=0.003)
    assert np.degrees(report.mount) == pytest.approx(-np.degrees(PLANTED[3:6]), abs=0.3)
    return True


@pytest.mark.slow  # a filter of one's own is flown by the default run
def test_beside_the_papers_filter_it_finds_its_values_and_moves_nothing():
    flight = Flight(seed=1, biases=PLANTED)
    tracks, report = flown(flight, filter="lowpass", self_calibration=True)
    alone, none = flown(flight, filter="lowpass")
    assert is_found(report)
    assert none is None
    reported = [[(t.id, t.position_ned, t.cov) for t in each] for each in tracks]
    assert reported == [[(t.id, t.position_ned, t.cov) for t in each] for each in alone]


def test_where_targets_may_move_it_learns_from_the_one_that_stands():
    walks = {"targets": ((2.0, 3.0), (-16.0, -8.0)), "velocities": ((0.0, 0.0), (0.5, 0.3)), "labels": ("a", "b")}
    _, report = flown(Flight(seed=1, biases=PLANTED, **walks), motion="moving", self_calibration=True)
    assert is_found(report)


@pytest.mark.parametrize("speed", [0.3, 1.5])
def test_from_what_moves_nothing_is_learned(speed):
    flight = Flight(
        seed=3, seconds=20, shape="hover", height_m=12.0, targets=((4.0, -5.0),), velocities=((0.0, speed),)
    )
    _, report = flown(flight, motion="moving", self_calibration=True)
    assert report.status in (CalibrationStatus.WAITING, CalibrationStatus.UNEXPLAINED)
    assert (report.time_offset_s, report.time_offset_sigma_s, report.mount) == (0.0, 0.05, (0.0, 0.0, 0.0))


def test_beside_a_filter_of_ones_own_it_finds_its_values_and_moves_nothing():
    flight = Flight(seed=2, biases=PLANTED)
    world = World(flight)
    tracker = tracker_with(StaticKalman(flight.priors), flight.priors, world.state_at, self_calibration=True)
    alone = tracker_with(StaticKalman(flight.priors), flight.priors)
    for view in world.frames():
        tracks, plain = tracker.on_frame(view), alone.on_frame(view)
    assert is_found(tracker.calibration)
    assert [t.position_ned for t in tracks] == [t.position_ned for t in plain]


@pytest.mark.parametrize(("crooked", "state"), [(True, TrackState.COASTING), (False, TrackState.DROPPED)])
def test_a_frame_whose_edge_a_crooked_mount_may_move_did_not_look(crooked, state):
    """The target is 0.3 m inside the image, 11 m away; a mount error of 1.5 degrees moves it by the same distance."""
    angle = np.radians(1.0 if crooked else 0.1)
    p = priors(mount_x=angle, mount_y=angle, mount_z=angle, heading=0.0, time_offset=0.0)
    tracker = make_tracker(TrackingOptions(self_calibration=True), p)
    reported = ()
    for k in range(60):
        fixes = [a_fix(k / 10, (4.0, 3.0, 0.0))] if k < FIRST_MEASUREMENTS else []  # too few for the joint estimate
        view = msgspec.structs.replace(a_view(k / 10, *fixes), could_see=lambda place: place[0] < 4.3)
        reported = tracker.on_frame(view) or reported
    assert reported[0].state is state
