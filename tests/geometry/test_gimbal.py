"""A gimbal's message, by scipy: where its yaw counts from, and which part the gimbal's own heading has in it."""

from math import nan, radians

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.gimbal import (
    gimbals_heading,
    has_both_frames,
    heading_only,
    is_locked,
    reported_attitude,
)
from fwav_companion.geometry.rotations import matrix_from_quaternion, quaternion_from_euler

LOCK, VEHICLE, EARTH = 16, 32, 64
HEADING = 70.0
LEVEL_LOOK = quaternion_from_euler(radians(2.0), radians(-40.0), radians(25.0))


def turned_about_down(deg: float) -> np.ndarray:
    return (
        Rotation.from_euler("Z", deg, degrees=True) * Rotation.from_euler("ZYX", [25.0, -40.0, 2.0], degrees=True)
    ).as_matrix()


@pytest.mark.parametrize(
    ("flags", "delta_yaw_deg", "turned_deg", "from_north"),
    [
        (EARTH, nan, 0.0, True),
        (EARTH, 0.0, 0.0, True),  # an older sender's cut-off field
        (EARTH, 66.0, -66.0, False),
        (EARTH | LOCK, 50.0, -50.0, False),
        (VEHICLE, nan, 0.0, False),
        (VEHICLE, 66.0, 0.0, False),
        (VEHICLE | LOCK, 66.0, 0.0, False),  # what ArduPilot sends: the lock is what the gimbal holds
        (0, 66.0, 0.0, False),  # an old sender: delta_yaw means nothing
        (LOCK, 66.0, 0.0, True),
        (1 | 2 | 4 | 8 | VEHICLE, nan, 0.0, False),  # other flags have no part in it
    ],
)
def test_yaw_counts_from_where_the_flags_say(flags, delta_yaw_deg, turned_deg, from_north):
    q, counts_from_north = reported_attitude(LEVEL_LOOK, flags, radians(delta_yaw_deg))
    assert np.array(matrix_from_quaternion(q)) == pytest.approx(turned_about_down(turned_deg), abs=1e-12)
    assert counts_from_north is from_north


@pytest.mark.parametrize("power_on_deg", [0.0, 5.0, 70.0, -160.0])
def test_the_zero_of_a_gimbals_heading_cancels_in_the_vehicles_frame(power_on_deg):
    """The gimbal counts its attitude and the vehicle's heading from the same wrong direction."""
    own_heading = HEADING + power_on_deg
    sent = quaternion_from_euler(radians(2.0), radians(-40.0), radians(25.0 + own_heading))
    q, _ = reported_attitude(sent, EARTH, radians(own_heading))
    assert np.array(matrix_from_quaternion(q)) == pytest.approx(turned_about_down(0.0), abs=1e-12)


@pytest.mark.parametrize(
    ("flags", "delta_yaw", "heading"),
    [(VEHICLE, 1.2, 1.2), (EARTH, 1.2, 1.2), (LOCK, 1.2, None), (0, 1.2, None), (EARTH, nan, None), (EARTH, 0.0, None)],
)
def test_the_gimbals_heading_is_read_only_where_the_message_has_it(flags, delta_yaw, heading):
    assert gimbals_heading(flags, delta_yaw) == heading


@pytest.mark.parametrize(
    ("flags", "locked"), [(4 | 8, True), (4, False), (8, False), (16, False), (12 | 16 | 32, True)]
)
def test_the_horizon_needs_both_locks(flags, locked):
    assert is_locked(flags) is locked


@pytest.mark.parametrize("pitch_deg", [90.0, -90.0])
def test_a_nose_straight_up_or_down_still_has_a_heading(pitch_deg):
    upright = matrix_from_quaternion(quaternion_from_euler(0.0, radians(pitch_deg), radians(HEADING)))
    expected = Rotation.from_euler("Z", HEADING, degrees=True).as_matrix()
    assert np.array(matrix_from_quaternion(heading_only(upright))) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("q", "flags"),
    [(LEVEL_LOOK, VEHICLE | EARTH), ((nan,) * 4, EARTH), ((0.0,) * 4, EARTH), ((1.0, nan, 0.0, 0.0), VEHICLE)],
)
def test_what_contradicts_itself_or_is_no_rotation_has_no_attitude(q, flags):
    assert reported_attitude(q, flags, 0.0) is None


def test_only_both_frame_flags_together_contradict():
    assert has_both_frames(VEHICLE | EARTH)
    assert not any(has_both_frames(flags) for flags in (0, LOCK, VEHICLE | LOCK, EARTH | LOCK))
