"""The error of the vehicle's position is common to all targets: it is found from the sightings and the true path."""

import pytest
import report_lines

from fwav_companion.tools.report.true_vehicle_path import TrueVehiclePath, mean_position_error, position_errors

PATH = TrueVehiclePath([1.0, 2.0, 3.0], [(0.0, 0.0, -10.0), (10.0, -4.0, -10.0), (10.0, 6.0, -10.0)])


def sighting(at_s, north, east, reason=None, frame=1):
    return report_lines.sighting(at_s, camera_ned=[north, east, -9.0], reason=reason, frame=frame)


def test_it_is_estimate_minus_truth_on_the_mean():
    lines = [report_lines.header(), sighting(1.5, 5.5, -1.0), sighting(2.25, 10.5, -1.0, frame=2)]
    errors = position_errors(lines, PATH)
    assert mean_position_error(errors) == pytest.approx((0.5, 0.75))
    assert mean_position_error(errors, [2]) == pytest.approx((0.5, 0.5))
    assert mean_position_error(errors, [2, 77]) == pytest.approx((0.5, 0.5))


def test_a_sighting_that_was_refused_or_is_outside_the_true_path_does_not_count():
    lines = [
        sighting(1.5, 7.0, -2.0),
        sighting(1.5, 99.0, 0.0, "no_clock"),
        sighting(9.0, 99.0, 0.0),
        sighting(0.5, 9.0, 9.0),
    ]
    assert mean_position_error(position_errors(lines, PATH)) == pytest.approx((2.0, 0.0))
    assert mean_position_error(position_errors(lines, TrueVehiclePath([1.0], [(0.0, 0.0, 0.0)]))) is None
    assert mean_position_error(position_errors(lines, PATH), [77]) is None
