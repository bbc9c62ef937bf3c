"""A wrong mount in words: the angles that are named are those of the mount that was found."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from simulated_flight import BODY_FROM_CAMERA

from fwav_companion.geometry.mounts import body_from_camera_from_euler
from fwav_companion.tracking.smoothed.named_mounts import named

CONFIGURED = BODY_FROM_CAMERA.as_matrix()


def turned(vector_deg):
    """The configured mount rotated by a rotation vector in body axes."""
    return Rotation.from_rotvec(np.radians(vector_deg)) * BODY_FROM_CAMERA


@pytest.mark.parametrize("vector_deg", [(-20, 25, 10), (18, 0, 0), (0, 20, 0), (0, 0, 25), (0, -45, 0), (30, 30, 30)])
def test_a_mount_far_off_is_named_as_it_is(vector_deg):
    true = turned(vector_deg)
    reported = [float(number) for number in re.findall(r"-?\d+", named(CONFIGURED, true.as_matrix()))]
    as_told = Rotation.from_matrix(body_from_camera_from_euler(*np.radians(reported[1:])))
    assert reported[0] == pytest.approx(np.linalg.norm(vector_deg), abs=3)
    assert np.degrees((true.inv() * as_told).magnitude()) < 4


@pytest.mark.parametrize("vector_deg", [(6, 0, 0), (0, 0, 0), (0, -8, 0)])
def test_a_mount_that_self_calibration_finds_is_not_named(vector_deg):
    assert named(CONFIGURED, turned(vector_deg).as_matrix()) == ""


@pytest.mark.parametrize("tilt_deg", [(0, 0, 0), (5, -3, 4)])
def test_an_upside_down_image_is_named_as_one_though_the_mount_is_a_little_off(tilt_deg):
    half = Rotation.from_rotvec(np.radians(tilt_deg)) * BODY_FROM_CAMERA * Rotation.from_euler("z", np.pi)
    assert "upside down" in named(CONFIGURED, half.as_matrix())
