"""What all answers of a flight have in common: the error of the position that they start from."""

import pytest

from fwav_companion.tools.demo.gnss_error import mean_position_error_m


def vehicle(at_s, north, east):
    return {"type": "vehicle", "boot_ns": round(at_s * 1e9), "position": [north, east, -10.0]}


def sighting(at_s, north, east, reason=None):
    return {"type": "sighting", "time_boot": at_s, "camera_ned": [north, east, -9.0], "reason": reason}


PATH = [{"type": "header"}, vehicle(1.0, 0.0, 0.0), vehicle(2.0, 10.0, -4.0), vehicle(3.0, 10.0, 6.0)]


def test_it_is_believed_minus_true_on_the_mean():
    lines = [{"type": "header"}, sighting(1.5, 5.5, -1.0), sighting(2.25, 10.5, -1.0)]
    assert mean_position_error_m(lines, PATH) == pytest.approx((0.5, 0.75))


def test_what_was_not_used_or_has_no_truth_beside_it_does_not_count():
    lines = [
        sighting(1.5, 7.0, -2.0),
        sighting(1.5, 99.0, 0.0, "no_clock"),
        sighting(9.0, 99.0, 0.0),
        sighting(0.5, 9, 9),
    ]
    assert mean_position_error_m(lines, PATH) == pytest.approx((2.0, 0.0))
    assert mean_position_error_m(lines, PATH[:2]) is None
    assert mean_position_error_m([], PATH) is None
