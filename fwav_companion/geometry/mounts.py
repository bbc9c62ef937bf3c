"""Camera mounts: from the configuration's angles to ``body_from_camera`` and back."""

from __future__ import annotations

from math import asin, atan2

from fwav_companion.geometry.rotations import (
    exp,
    matrix_from_quaternion,
    quaternion_from_euler,
)
from fwav_companion.geometry.vectors import Matrix3, Vector3, multiply, transform, transpose

BODY_FROM_FORWARD_CAMERA: Matrix3 = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""A camera (x right, y down, z forward) that looks along body x, its image's right at the body's right."""


def body_from_camera_from_euler(roll: float, pitch: float, yaw: float) -> Matrix3:
    """Rz(yaw) Ry(pitch) Rx(roll) of the forward-looking camera; pitch = -90° looks down, image top to the nose."""
    return multiply(matrix_from_quaternion(quaternion_from_euler(roll, pitch, yaw)), BODY_FROM_FORWARD_CAMERA)


def euler_from_body_from_camera(body_from_camera: Matrix3) -> tuple[float, float, float]:
    """(roll, pitch, yaw) that give this mount. Straight down or up leaves roll and yaw inseparable: roll is then 0."""
    rotation = multiply(body_from_camera, transpose(BODY_FROM_FORWARD_CAMERA))
    sin_pitch = max(-1.0, min(1.0, -rotation[2][0]))
    if abs(sin_pitch) > 1.0 - 1e-12:
        return (0.0, asin(sin_pitch), atan2(-rotation[0][1], rotation[1][1]))
    return (
        atan2(rotation[2][1], rotation[2][2]),
        asin(sin_pitch),
        atan2(rotation[1][0], rotation[0][0]),
    )


def corrected_mount(body_from_camera: Matrix3, correction: Vector3) -> Matrix3:
    """Exp(correction) body_from_camera: a rotation vector in body axes, radians."""
    return multiply(matrix_from_quaternion(exp(correction)), body_from_camera)


def describe_mount(body_from_camera: Matrix3) -> str:
    """Where the optical axis and the image's top point, in words, for logs and ``check``."""
    axis = transform(body_from_camera, (0.0, 0.0, 1.0))
    top = transform(body_from_camera, (0.0, -1.0, 0.0))
    return f"camera looks {_direction(axis)}, image top toward {_direction(top)}"


def _direction(v: Vector3) -> str:
    names = (("the nose", "the tail"), ("the right wing", "the left wing"), ("down", "up"))
    index = max(range(3), key=lambda i: abs(v[i]))
    return names[index][0 if v[index] > 0 else 1]
