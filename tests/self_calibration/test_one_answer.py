"""The published place once self-calibration has found the mount: it is the joint estimate's, and it does not jump."""

from itertools import pairwise

import msgspec
import numpy as np
import pytest
from draws import first_of
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration import CalibrationStatus
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias


class SureState:
    """A filter's state that claims a millimetre."""

    position_ned = (9.0, 9.0, 0.0)
    cov = ((1e-6, 0.0, 0.0), (0.0, 1e-6, 0.0), (0.0, 0.0, 1e-6))
    relative_cov = cov


def test_no_claim_of_a_targets_own_filter_replaces_the_calibrated_place():
    flight = Flight(seed=1, seconds=30.0)
    world = World(flight)
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    for view in world.frames():
        tracker.on_frame(view)
    calibrator = tracker.snapshot().calibrator
    assert calibrator.is_calibrated
    (track,) = (each for each in tracker.snapshot().alive if calibrator.placed(each.id) is not None)
    place = tracker._choice().target(msgspec.structs.replace(track, target=SureState())).position_ned
    assert place[:2] == pytest.approx((2.0, 3.0), abs=0.1)


def published(flight):
    """(calibrated, published place, one sigma, joint estimate's place) of the target after each frame that has all."""
    world = World(flight)
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    for view in world.frames():
        for track in tracker.on_frame(view):
            calibrator = tracker.snapshot().calibrator
            placed = calibrator.placed(track.id)
            if placed is not None and track.confirmed_host_ns is not None:
                place = np.array(track.position_ned[:2])
                yield calibrator.is_calibrated, place, np.sqrt(track.cov[0][0]), (placed.north, placed.east)


@pytest.mark.parametrize("seed", first_of(6, 1))
def test_a_calibrated_place_never_falls_back_to_the_uncalibrated_one(seed):
    """With a wandering heading the filter of the target alone claims less than the calibrated estimate."""
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET] = 0.035
    biases[[Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]] = np.radians([0.5, 1.0, 2.0])
    flight = Flight(seed=seed, fps=15, biases=biases, heading_wander=np.radians(2.0))
    seen = [each for each in published(flight) if each[0]]
    assert len(seen) > 100
    for before, after in pairwise(seen):
        assert after[1] == pytest.approx(after[3], abs=1e-12)
        assert np.hypot(*(after[1] - before[1])) < 3.0 * before[2]


@pytest.mark.parametrize(
    "slip",
    [pytest.param({Bias.MOUNT_Y: np.radians(3.0)}, id="mount"), pytest.param({Bias.TIME_OFFSET: 0.06}, id="delay")],
)
def test_what_slips_in_flight_moves_the_published_place_by_no_more_than_its_claim(slip):
    """The mount slips by 2 degrees, or the camera is late by another 25 ms, once both were known.
    A step is judged by the claim before it, and where innovations disproved that, by the one after it.
    """
    before, after = np.zeros(BIAS_COUNT), np.zeros(BIAS_COUNT)
    for biases in (before, after):
        biases[Bias.TIME_OFFSET] = 0.035
        biases[[Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]] = np.radians([0.5, 1.0, 2.0])
    for bias, value in slip.items():
        after[bias] = value
    worlds = [World(Flight(seed=2, fps=15, biases=biases)) for biases in (before, after)]
    frames = worlds[0].frames()[:500] + worlds[1].frames()[500:]
    tracker = make_tracker(TrackingOptions(self_calibration=True), worlds[0].flight.priors, worlds[0].state_at)
    last, statuses = None, []
    for view in frames:
        confirmed = [track for track in tracker.on_frame(view) if track.confirmed_host_ns is not None]
        if not confirmed:
            continue
        track, status = min(confirmed, key=lambda each: each.id), tracker.calibration.status
        place, cov = np.array(track.position_ned[:2]), np.array(track.cov)[:2, :2]
        if last is not None and last[0] == track.id:
            falls_back = last[3] is CalibrationStatus.CALIBRATED is not status
            step, claim = place - last[1], cov if falls_back else last[2]
            assert step @ np.linalg.solve(claim, step) < 3.0**2, (view.frame, last[3], status)
        last = (track.id, place, cov, status)
        statuses.append((view.frame, status))
    assert CalibrationStatus.CALIBRATED in [status for frame, status in statuses if frame < 500]
    assert statuses[-1][1] is not CalibrationStatus.CALIBRATED


def late(seed):
    """Over one target by a position that wanders: the camera is 20 ms late, as flapping shows; the mount is hidden."""
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET] = 0.02
    unsure = priors(time_offset=0.012, position_north=1.0, position_east=1.0)
    return Flight(seed=seed, seconds=8.0, shape="hover", targets=((4.0, 3.0),), biases=biases, priors=unsure)


@pytest.mark.parametrize("seed", first_of(4, 1))
def test_once_the_delay_is_known_the_answer_rests_on_it_and_not_on_its_prior(seed):
    world = World(late(seed))
    tracker = make_tracker(TrackingOptions(self_calibration=True), world.flight.priors, world.state_at)
    statuses = []
    for view in world.frames():
        for track in tracker.on_frame(view):
            calibrator = tracker.snapshot().calibrator
            placed, status = calibrator.placed(track.id), tracker.calibration.status
            if placed is not None and status is CalibrationStatus.TIME:
                statuses.append(status)
                assert track.position_ned[:2] == pytest.approx((placed.north, placed.east), abs=1e-12)
    assert len(statuses) > 50


def test_where_no_constant_mount_explains_the_flight_the_targets_own_filter_answers():
    calibrator = calibrated(late(1))
    drifting = msgspec.structs.replace(calibrator.assessment, constant=False, status=CalibrationStatus.TIME)
    waiting = msgspec.structs.replace(calibrator.assessment, status=CalibrationStatus.WAITING)
    assert calibrator.answers
    assert not msgspec.structs.replace(calibrator, assessment=drifting).answers
    assert not msgspec.structs.replace(calibrator, assessment=waiting).answers


def calibrated(flight):
    """The state of self-calibration after a flight."""
    world = World(flight)
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    for view in world.frames():
        tracker.on_frame(view)
    return tracker.snapshot().calibrator
