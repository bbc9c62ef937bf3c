"""Mount angles against scipy and against pictures one can hold in mind."""

from math import pi, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.mounts import (
    body_from_camera_from_euler,
    corrected_mount,
    describe_mount,
    euler_from_body_from_camera,
)

angles = st.floats(-pi, pi)
pitches = st.one_of(st.floats(-pi / 2, pi / 2), st.sampled_from([-pi / 2, pi / 2, 0.0]))
repeatable = settings(derandomize=True, max_examples=150, deadline=None)


def test_forward_and_down_are_the_matrices_of_the_textbook():
    assert np.array(body_from_camera_from_euler(0, 0, 0)) == pytest.approx(np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]))
    down = body_from_camera_from_euler(0.0, radians(-90.0), 0.0)
    assert np.array(down) == pytest.approx(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), abs=1e-15)


@pytest.mark.parametrize(
    ("roll", "pitch", "yaw", "says"),
    [
        (0, -90, 0, "camera looks down, image top toward the nose"),
        (0, 0, 0, "camera looks the nose, image top toward up"),
        (0, 0, 90, "camera looks the right wing, image top toward up"),
        (0, -90, 180, "camera looks down, image top toward the tail"),
        (180, 0, 0, "camera looks the nose, image top toward down"),
    ],
)
def test_a_mount_in_words(roll, pitch, yaw, says):
    assert describe_mount(body_from_camera_from_euler(*map(radians, (roll, pitch, yaw)))) == says


@repeatable
@given(angles, pitches, angles)
def test_angles_against_scipy_and_back(roll, pitch, yaw):
    mount = body_from_camera_from_euler(roll, pitch, yaw)
    theirs = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix() @ [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    again = body_from_camera_from_euler(*euler_from_body_from_camera(mount))
    assert np.array(mount) == pytest.approx(theirs, abs=1e-12)
    assert np.array(again) == pytest.approx(np.array(mount), abs=1e-6)


def test_a_correction_is_a_rotation_vector_in_body_axes():
    mount = body_from_camera_from_euler(0.1, -1.2, 0.3)
    correction = (0.01, -0.02, 0.03)
    expected = Rotation.from_rotvec(correction).as_matrix() @ np.array(mount)
    assert np.array(corrected_mount(mount, correction)) == pytest.approx(expected, abs=1e-12)
