"""Camera mounts: the rotation ``body_from_camera`` from the configured angles, and the angles of such a rotation."""

from __future__ import annotations

from fwav_companion.geometry.rotations import (
    euler_from_matrix,
    exp,
    matrix_from_quaternion,
    quaternion_from_euler,
)
from fwav_companion.geometry.vectors import Matrix3, Vector3, multiply, transform, transpose

BODY_FROM_FORWARD_CAMERA: Matrix3 = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Rotation of a camera (x right, y down, z forward) that looks along body x, image right = body right."""


def body_from_camera_from_euler(roll: float, pitch: float, yaw: float) -> Matrix3:
    """The mount Rz(yaw) Ry(pitch) Rx(roll) of the forward-looking camera, radians.

    pitch = -90° looks straight down with the image top toward the nose: the MAVLink gimbal convention.
    """
    return multiply(matrix_from_quaternion(quaternion_from_euler(roll, pitch, yaw)), BODY_FROM_FORWARD_CAMERA)


def euler_from_body_from_camera(body_from_camera: Matrix3) -> tuple[float, float, float]:
    """(roll, pitch, yaw) of the mount, radians; roll is 0 for a camera that looks straight down or up."""
    return euler_from_matrix(multiply(body_from_camera, transpose(BODY_FROM_FORWARD_CAMERA)))


def corrected_mount(body_from_camera: Matrix3, correction: Vector3) -> Matrix3:
    """The mount Exp(correction) body_from_camera; ``correction`` is a rotation vector in body axes, radians."""
    return multiply(matrix_from_quaternion(exp(correction)), body_from_camera)


def describe_mount(body_from_camera: Matrix3) -> str:
    """The directions of the optical axis and of the image's top in words, for logs and ``check``."""
    axis = transform(body_from_camera, (0.0, 0.0, 1.0))
    top = transform(body_from_camera, (0.0, -1.0, 0.0))
    return f"camera looks {_direction(axis)}, image top toward {_direction(top)}"


def _direction(v: Vector3) -> str:
    names = (("the nose", "the tail"), ("the right wing", "the left wing"), ("down", "up"))
    index = max(range(3), key=lambda i: abs(v[i]))
    return names[index][0 if v[index] > 0 else 1]
