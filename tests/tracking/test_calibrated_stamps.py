"""Self-calibration where the autopilot's attitudes are late: no delay of the camera can be told from it."""

from functools import cache

import numpy as np
import pytest
from draws import first_of
from simulated_flight import Flight
from simulated_world import World
from smoothed_flights import tracked

from fwav_companion.types import BIAS_COUNT, Bias
from fwav_companion.types.calibration_report import CalibrationStatus

PLANTED = np.zeros(BIAS_COUNT)
PLANTED[Bias.TIME_OFFSET] = 0.035
PLANTED[[Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]] = np.radians([0.5, 1.0, 2.0])


@cache
def flown(**options):
    """(last state of the oldest confirmed track, report) after 45 s."""
    best = tracker = None
    for tracker, tracks in tracked(World(Flight(seed=3, biases=PLANTED, seconds=45, **options))):  # noqa: B007
        for track in tracks:
            if track.confirmed_host_ns is not None and (best is None or track.id == best.id):
                best = track
    return best, tracker.calibration


LATE = first_of(0.00125, -0.00125)


@pytest.mark.parametrize("late_by", LATE)
def test_attitudes_that_are_all_as_late_are_no_delay_of_the_camera(late_by):
    """They look like a camera delay, and make no target worse."""
    track, report = flown(late_by=late_by)
    assert report.time_offset_s + late_by == pytest.approx(0.035, abs=0.0008)
    assert report.keep.time_offset_sigma_s == report.time_offset_sigma_s
    assert np.hypot(*np.subtract(track.position_ned[:2], (2.0, 3.0))) < 0.06


@pytest.mark.xfail(
    strict=True,
    reason="33.79 and 36.29 ms are claimed with a sigma of 0.27 ms, 4.5 and 4.8 sigmas off: the lateness that all "
    "attitudes have in common is not in the claim",
)
@pytest.mark.parametrize("late_by", LATE)
def test_the_delay_is_covered_even_at_the_end_of_what_stamps_leave_open(late_by):
    _, report = flown(late_by=late_by)
    assert abs(report.time_offset_s - 0.035) < 3 * report.time_offset_sigma_s < 0.002


OPEN_S = 0.01
"""One sigma of the stamps of attitudes, s."""


def test_attitudes_whose_instant_is_open_still_place_the_target():
    track, report = flown(late_by=0.0, stamp_late_s=OPEN_S * np.sqrt(12.0))
    error = np.subtract(track.position_ned[:2], (2.0, 3.0))
    assert report.status is CalibrationStatus.CALIBRATED
    assert abs(report.time_offset_s - 0.035) < 3 * report.time_offset_sigma_s
    assert error @ np.linalg.solve(np.array(track.cov)[:2, :2], error) < 9.0


@pytest.mark.xfail(strict=True, reason="stamps that are open by 10 ms leave a claim of 0.27 ms")
def test_attitudes_whose_instant_is_open_leave_the_delay_as_open():
    """For example with two attitudes a beat: any delay fits them."""
    _, report = flown(late_by=0.0, stamp_late_s=OPEN_S * np.sqrt(12.0))
    assert report.time_offset_sigma_s >= OPEN_S / 2
