"""Whether the autopilot's filter vouches for its local position: flags that mean different things at the two."""

from types import SimpleNamespace

import pytest

from fwav_companion.telemetry.filter_status import FilterStatus

FLYING = 1 | 2 | 4 | 8 | 32
"""Attitude, both velocities, relative position, height: a vehicle by optical flow."""
ON_GROUND, IN_AIR = 1, 2


def ardupilot(flags, *, armed=True, velocity=0.1, position=0.1):
    status = FilterStatus()
    status.on_heartbeat(armed=armed)
    status.on_ardupilot_filter(SimpleNamespace(flags=flags, velocity_variance=velocity, pos_horiz_variance=position))
    return status.local_trouble


def px4(flags, *, armed=True, landed_state=IN_AIR, velocity=0.1, position=0.1):
    status = FilterStatus()
    status.on_heartbeat(armed=armed)
    status.on_landed_state(landed_state)
    status.on_px4_filter(SimpleNamespace(flags=flags, vel_ratio=velocity, pos_horiz_ratio=position))
    return status.local_trouble


def test_before_a_report_nothing_is_known():
    assert FilterStatus().local_trouble is None


@pytest.mark.parametrize("of", [ardupilot, px4])
@pytest.mark.parametrize("position", [8, 16, 8 | 16])
def test_filter_in_flight_with_any_horizontal_position_is_good(of, position):
    assert of(1 | 2 | 4 | 32 | position) == ""


@pytest.mark.parametrize(
    ("of", "flags", "said"),
    [
        (ardupilot, FLYING & ~1, "attitude"),
        (ardupilot, FLYING & ~2, "velocity"),
        (ardupilot, FLYING & ~8, "no horizontal position"),
        (ardupilot, FLYING | 128, "constant position"),
        (ardupilot, FLYING | 1024, "not started"),
        (px4, FLYING & ~1, "attitude"),
        (px4, FLYING & ~2, "horizontal velocity"),
        (px4, FLYING & ~4, "vertical velocity"),
        (px4, FLYING & ~8, "no horizontal position"),
        (px4, FLYING | 128, "constant position"),
        (px4, FLYING | 2048, "accelerometer"),
    ],
)
def test_filter_in_flight_without_a_flag_or_with_a_bad_one_is_named_by_it(of, flags, said):
    assert said in of(flags)


def test_bit_1024_is_a_glitch_of_the_receiver_at_px4_and_leaves_the_local_position_good():
    assert px4(FLYING | 1024) == ""


def test_constant_position_of_a_px4_counts_in_the_air_alone():
    at_rest = FLYING | 128
    assert px4(at_rest, landed_state=ON_GROUND) == "", "armed and at rest"
    assert px4(at_rest, armed=False, landed_state=0) == "", "no EXTENDED_SYS_STATE"
    assert "constant position" in px4(at_rest, landed_state=0), "armed counts as in the air"


@pytest.mark.parametrize("predicted", [256, 512])
def test_disarmed_ardupilot_is_good_by_what_it_predicts_for_the_flight(predicted):
    on_the_ground = 1 | 128 | predicted
    assert ardupilot(on_the_ground, armed=False) == ""
    assert ardupilot(on_the_ground, armed=True) != ""
    assert "expected" in ardupilot(1 | 128, armed=False)


@pytest.mark.parametrize("of", [ardupilot, px4])
@pytest.mark.parametrize("ratio", [1.0, float("nan")])
def test_filter_that_rejects_its_own_measurements_is_not_good(of, ratio):
    assert "velocity" in of(FLYING, velocity=ratio)
    assert "position" in of(FLYING, position=ratio)
