"""Rotations against scipy's independent ones."""

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fwav_companion.geometry import rotations as ours
from fwav_companion.geometry import vectors

repeatable = settings(derandomize=True, max_examples=150, deadline=None)
angles = st.floats(-pi, pi)
pitches = st.floats(-pi / 2 + 1e-6, pi / 2 - 1e-6)
components = st.floats(-1.0, 1.0)
quaternions = (
    st.tuples(components, components, components, components)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(ours.normalized)
)
points = st.tuples(*(st.floats(-100.0, 100.0),) * 3)


def scipys(q) -> Rotation:
    return Rotation.from_quat([q[1], q[2], q[3], q[0]])


@repeatable
@given(angles, pitches, angles)
def test_euler_angles_are_those_of_the_attitude_message(roll, pitch, yaw):
    q = ours.quaternion_from_euler(roll, pitch, yaw)
    theirs = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    assert np.array(ours.matrix_from_quaternion(q)) == pytest.approx(theirs.as_matrix(), abs=1e-12)
    again = ours.quaternion_from_euler(*ours.euler_from_quaternion(q))
    assert abs(np.dot(again, q)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("pitch", [pi / 2, -pi / 2])
def test_straight_up_and_down_come_back_as_the_same_attitude(pitch):
    q = ours.quaternion_from_euler(0.4, pitch, 1.1)
    again = ours.quaternion_from_euler(*ours.euler_from_quaternion(q))
    assert np.array(ours.matrix_from_quaternion(again)) == pytest.approx(
        np.array(ours.matrix_from_quaternion(q)), abs=1e-7
    )


@repeatable
@given(quaternions, quaternions, points)
def test_products_and_turned_vectors(a, b, point):
    assert ours.rotate(ours.multiply(a, b), point) == pytest.approx((scipys(a) * scipys(b)).apply(point), abs=1e-9)
    assert ours.rotate(ours.conjugate(a), ours.rotate(a, point)) == pytest.approx(point, abs=1e-9)
    assert vectors.transform(ours.matrix_from_quaternion(a), point) == pytest.approx(scipys(a).apply(point), abs=1e-9)


@repeatable
@given(quaternions)
def test_a_matrix_gives_its_quaternion_back(q):
    again = ours.quaternion_from_matrix(ours.matrix_from_quaternion(q))
    assert again[0] >= 0.0
    assert abs(np.dot(again, q)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0.8, 0), (0.0, -0.6, 0.8)])
@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 9.9e-5, 1.01e-4, 0.5, 3.0, pi - 1e-9, pi])
def test_exp_and_log_from_nothing_to_half_a_turn(axis, angle):
    vector = tuple(angle * x for x in axis)
    q = ours.exp(vector)
    assert np.array(ours.matrix_from_quaternion(q)) == pytest.approx(
        Rotation.from_rotvec(vector).as_matrix(), abs=1e-14
    )
    assert ours.log(q) == pytest.approx(vector, abs=1e-12) or ours.log(q) == pytest.approx(
        np.negative(vector), abs=1e-9
    )


@repeatable
@given(quaternions, quaternions)
def test_a_difference_carries_one_attitude_to_the_other(a, b):
    vector = ours.difference(b, a)
    assert np.linalg.norm(vector) <= pi + 1e-9
    assert abs(np.dot(ours.multiply(a, ours.exp(vector)), b)) == pytest.approx(1.0, abs=1e-12)
    assert np.linalg.norm(vector) == pytest.approx((scipys(a).inv() * scipys(b)).magnitude(), abs=1e-7)


@repeatable
@given(points, points)
def test_vectors_against_numpy(a, b):
    assert vectors.cross(a, b) == pytest.approx(np.cross(a, b), abs=1e-9)
    assert vectors.dot(a, b) == pytest.approx(np.dot(a, b), abs=1e-9)
    assert np.array(vectors.outer(a, b)) == pytest.approx(np.outer(a, b), abs=1e-9)


@repeatable
@given(st.tuples(*(components,) * 9), st.tuples(*(components,) * 9))
def test_matrices_against_numpy(a, b):
    m, n = np.reshape(a, (3, 3)), np.reshape(b, (3, 3))
    as_rows = [tuple(map(tuple, x.tolist())) for x in (m, n)]
    assert np.array(vectors.multiply(*as_rows)) == pytest.approx(m @ n, abs=1e-12)
    assert np.array(vectors.transpose(as_rows[0])) == pytest.approx(m.T)
    cov = m @ m.T
    largest = np.sqrt(np.linalg.eigvalsh(cov[:2, :2]).max())
    assert vectors.larger_semi_axis(tuple(map(tuple, cov.tolist()))) == pytest.approx(largest, abs=1e-9)
