"""Rotations in scalar arithmetic: ``ned_from_body = Rz(yaw) Ry(pitch) Rx(roll)``, body FRD, world NED, radians."""

from __future__ import annotations

from math import asin, atan2, cos, hypot, sin, sqrt

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
Quaternion = tuple[float, float, float, float]

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
FORWARD_CAMERA: Matrix = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""body_from_camera of a camera (x right, y down, z forward) that looks along body x, image right = body right."""


def matrix_from_euler(roll: float, pitch: float, yaw: float) -> Matrix:
    """ned_from_body from Euler angles."""
    sr, cr, sp, cp, sy, cy = sin(roll), cos(roll), sin(pitch), cos(pitch), sin(yaw), cos(yaw)
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Quaternion (w, x, y, z) of ned_from_body from Euler angles."""
    sr, cr = sin(roll / 2), cos(roll / 2)
    sp, cp = sin(pitch / 2), cos(pitch / 2)
    sy, cy = sin(yaw / 2), cos(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def euler_from_matrix(m: Matrix) -> Vector:
    """Roll, pitch, yaw, radians, of Rz(yaw) Ry(pitch) Rx(roll)."""
    return (atan2(m[2][1], m[2][2]), asin(max(-1.0, min(1.0, -m[2][0]))), atan2(m[1][0], m[0][0]))


def matrix_from_rotation_vector(v: Vector) -> Matrix:
    """Exp(v), by Rodrigues' formula."""
    angle = hypot(*v)
    if angle < 1e-12:
        return IDENTITY
    x, y, z = (component / angle for component in v)
    s, c = sin(angle), cos(angle)
    k = 1.0 - c
    return (
        (c + x * x * k, x * y * k - z * s, x * z * k + y * s),
        (y * x * k + z * s, c + y * y * k, y * z * k - x * s),
        (z * x * k - y * s, z * y * k + x * s, c + z * z * k),
    )


def body_rates(roll: float, pitch: float, roll_rate: float, pitch_rate: float, yaw_rate: float) -> Vector:
    """Body rates (p, q, r) from the rates of the Euler angles."""
    sr, cr, sp, cp = sin(roll), cos(roll), sin(pitch), cos(pitch)
    return (
        roll_rate - yaw_rate * sp,
        pitch_rate * cr + yaw_rate * cp * sr,
        yaw_rate * cp * cr - pitch_rate * sr,
    )


def times(a: Matrix, b: Matrix) -> Matrix:
    """Matrix product: b is applied first, then a."""
    columns = transposed(b)
    return tuple(tuple(dot(row, column) for column in columns) for row in a)  # type: ignore[return-value]


def apply(m: Matrix, v: Vector) -> Vector:
    """Vector v turned by m."""
    x, y, z = v
    (a, b, c), (d, e, f), (g, h, i) = m
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def apply_transposed(m: Matrix, v: Vector) -> Vector:
    """Transpose of m, times v: the inverse rotation."""
    x, y, z = v
    (a, b, c), (d, e, f), (g, h, i) = m
    return (a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z)


def transposed(m: Matrix) -> Matrix:
    """Transpose of a matrix."""
    return tuple(zip(*m, strict=True))  # type: ignore[return-value]


def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def plus(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def minus(a: Vector, b: Vector) -> Vector:
    """Difference of two vectors."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def norm(a: Vector) -> float:
    """Length of a vector."""
    return sqrt(dot(a, a))
