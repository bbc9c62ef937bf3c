"""The tracker by the smoother without a position: targets are relative to the point below the camera."""

import numpy as np
import pytest
from flying import fly

from fwav_companion.recording.line_types import CalibrationLine
from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions
from sitl_mock import scenario

SETTINGS = ((), ("vehicle.position=none",))


@pytest.mark.parametrize("settings", SETTINGS)
def test_target_is_placed_from_the_vehicle_and_nothing_is_calibrated(settings):
    options = scenario("no_gps" if not settings else "hover").but({"seconds": 24.0, "seed": 4})
    flown = fly(options, (*settings, "tracking.self_calibration=true"), smoother=SmootherOptions())
    lines = [line for line in flown.companion.targets() if line.state == "confirmed"]
    assert len(lines) > 100
    assert lines[-1].lat is None
    errors, squares = zip(*(flown.relative_error(line) for line in lines[len(lines) // 3 :: 10]), strict=True)
    assert np.median(errors) < 1.5
    assert np.median(squares) < 6.0
    last = [line for line in flown.companion.lines if isinstance(line, CalibrationLine)][-1]
    assert last.status == "waiting"
    assert "global position" in last.reason
    assert last.time_offset_s == 0.0


def test_position_that_comes_late_begins_again_with_new_tracks():
    flown = fly(scenario("late_gps").but({"seconds": 30.0, "seed": 3}), smoother=SmootherOptions())
    reasons = {line.reason for line in flown.companion.targets() if line.state == "dropped"}
    assert "origin_set" in reasons
    assert flown.final().lat is not None
    assert flown.error_m(flown.final()) < 5.0
