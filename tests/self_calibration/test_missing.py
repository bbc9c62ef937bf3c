"""The reason of every status but calibrated, and what it advises."""

import numpy as np
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration import CalibrationStatus
from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.calibrator import MOST_TARGETS, Calibrator
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias

LATE = np.zeros(BIAS_COUNT)
LATE[Bias.TIME_OFFSET] = 0.02


def reasons(flight):
    """(status, reason) after each frame."""
    world = World(flight)
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    for view in world.frames():
        tracker.on_frame(view)
        yield tracker.calibration.status, tracker.calibration.reason


def hovering(**options):
    return Flight(shape="hover", height_m=10.0, targets=((4.0, 3.0),), seconds=10.0, biases=LATE, **options)


def test_a_hover_counts_its_sights_and_then_advises_other_views():
    seen = list(reasons(hovering()))
    assert seen[0] == (CalibrationStatus.WAITING, "no target was seen long enough with a global position")
    counted = [reason for _, reason in seen if reason.endswith(" of 40 sights")]
    assert counted[0].startswith("3 ")
    status, reason = seen[-1]
    assert status is CalibrationStatus.TIME
    assert "of its prior" in reason
    assert "turn twice, climb 5 m; or three targets" in reason


def test_a_wandering_position_is_named_where_it_hides_the_mount():
    wandering = priors(position_north=1.0, position_east=1.0)
    status, reason = list(reasons(Flight(seconds=30.0, biases=LATE, priors=wandering)))[-1]
    assert status is not CalibrationStatus.CALIBRATED
    assert "a position error of 1 m hides the mount" in reason


def test_slow_attitudes_are_named_with_their_rate():
    slow = hovering(attitude_hz=3.3, late_by=0.0, stamp_late_s=0.3)
    assert list(reasons(slow))[-1] == (CalibrationStatus.WAITING, "attitudes at 3.3 Hz")


def test_a_calibrated_flight_lacks_nothing():
    seen = list(reasons(Flight(seed=1, seconds=30.0)))
    assert seen[-1] == (CalibrationStatus.CALIBRATED, None)
    assert all((reason is None) is (status is CalibrationStatus.CALIBRATED) for status, reason in seen)


def test_the_estimate_holds_a_bounded_number_of_targets():
    calibrator = Calibrator(CalibrationContext(priors(), None))
    assert calibrator._teaching(range(1, MOST_TARGETS + 2)) == set(range(1, MOST_TARGETS + 1))
