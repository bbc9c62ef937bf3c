"""A gimbal's attitude, by scipy: levelled already, and its yaw counts from where the flags say."""

from math import nan, radians

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.gimbal import ned_from_gimbal
from fwav_companion.geometry.rotations import matrix_from_quaternion, quaternion_from_euler

LOCK, VEHICLE, EARTH = 16, 32, 64
HEADING = 70.0
BODY = matrix_from_quaternion(quaternion_from_euler(radians(20.0), radians(-15.0), radians(HEADING)))
LEVEL_LOOK = quaternion_from_euler(radians(2.0), radians(-40.0), radians(25.0))


def expected(yaw_offset_deg: float) -> np.ndarray:
    return (
        Rotation.from_euler("Z", yaw_offset_deg, degrees=True)
        * Rotation.from_euler("ZYX", [25.0, -40.0, 2.0], degrees=True)
    ).as_matrix()


@pytest.mark.parametrize(
    ("flags", "delta_yaw_deg", "offset_deg"),
    [
        (EARTH, nan, 0.0),
        (EARTH | LOCK, 50.0, 0.0),
        (VEHICLE, nan, HEADING),
        (VEHICLE, 0.0, HEADING),
        (VEHICLE, 66.0, 66.0),
        (VEHICLE | LOCK, 66.0, 66.0),
        (0, 66.0, HEADING),  # an old sender: delta_yaw means nothing
        (LOCK, 66.0, 0.0),
        (1 | 2 | 4 | 8 | VEHICLE, nan, HEADING),  # other flags have no part in it
    ],
)
def test_yaw_counts_from_where_the_flags_say(flags, delta_yaw_deg, offset_deg):
    q = ned_from_gimbal(LEVEL_LOOK, flags, BODY, radians(delta_yaw_deg))
    assert np.array(matrix_from_quaternion(q)) == pytest.approx(expected(offset_deg), abs=1e-12)


def test_the_vehicles_roll_and_pitch_are_not_counted_twice():
    level = matrix_from_quaternion(quaternion_from_euler(0.0, 0.0, radians(HEADING)))
    assert ned_from_gimbal(LEVEL_LOOK, VEHICLE, BODY, nan) == pytest.approx(
        ned_from_gimbal(LEVEL_LOOK, VEHICLE, level, nan), abs=1e-12
    )


@pytest.mark.parametrize("pitch_deg", [90.0, -90.0])
def test_a_nose_straight_up_or_down_still_has_a_heading(pitch_deg):
    upright = matrix_from_quaternion(quaternion_from_euler(0.0, radians(pitch_deg), radians(HEADING)))
    q = ned_from_gimbal(LEVEL_LOOK, VEHICLE, upright, nan)
    assert np.array(matrix_from_quaternion(q)) == pytest.approx(expected(HEADING), abs=1e-6)


@pytest.mark.parametrize(
    ("q", "flags"),
    [(LEVEL_LOOK, VEHICLE | EARTH), ((nan,) * 4, EARTH), ((0.0,) * 4, EARTH), ((1.0, nan, 0.0, 0.0), VEHICLE)],
)
def test_what_contradicts_itself_or_is_no_rotation_has_no_attitude(q, flags):
    assert ned_from_gimbal(q, flags, BODY, 0.0) is None
