"""Unit quaternions (w, x, y, z), rotation vectors and Z-Y-X Euler angles, in scalar ``math``."""

from __future__ import annotations

from functools import lru_cache
from math import asin, atan2, cos, sin, sqrt
from typing import TypeAlias

from fwav_companion.geometry.vectors import Matrix3, Vector3, transpose

Quaternion: TypeAlias = tuple[float, float, float, float]

VERTICAL = 1.0 - 1e-12
"""Absolute sine of the pitch above which roll and yaw are not separable: 1.4e-6 rad from vertical."""


def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """The rotation Rz(yaw) Ry(pitch) Rx(roll), the aerospace order: ``ned_from_body`` of MAVLink's ATTITUDE."""
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    cp, sp = cos(0.5 * pitch), sin(0.5 * pitch)
    cy, sy = cos(0.5 * yaw), sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def euler_from_quaternion(q: Quaternion) -> tuple[float, float, float]:
    """(roll, pitch, yaw) of a unit quaternion, as :func:`euler_from_matrix`."""
    return euler_from_matrix(matrix_from_quaternion(q))


def euler_from_matrix(m: Matrix3) -> tuple[float, float, float]:
    """(roll, pitch, yaw) of the rotation matrix Rz(yaw) Ry(pitch) Rx(roll); at pitch = ±90° roll is taken as 0."""
    sin_pitch = max(-1.0, min(1.0, -m[2][0]))
    if abs(sin_pitch) > VERTICAL:
        return (0.0, asin(sin_pitch), atan2(-m[0][1], m[1][1]))
    return (atan2(m[2][1], m[2][2]), asin(sin_pitch), atan2(m[1][0], m[0][0]))


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """The Hamilton product a b: c_from_a is c_from_b times b_from_a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def conjugate(q: Quaternion) -> Quaternion:
    """The conjugate of q, which is the inverse rotation of a unit quaternion."""
    return (q[0], -q[1], -q[2], -q[3])


def normalized(q: Quaternion) -> Quaternion:
    """The unit quaternion q / |q|; ZeroDivisionError for the zero quaternion, which is not a rotation."""
    w, x, y, z = q
    s = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return (w * s, x * s, y * s, z * s)


@lru_cache(maxsize=32)
def matrix_from_quaternion(q: Quaternion) -> Matrix3:
    """The 3x3 rotation matrix of a unit quaternion. Cached: the detections of a row, and every use of one, share it."""
    w, x, y, z = q
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return (
        (1.0 - (yy + zz), xy - wz, xz + wy),
        (xy + wz, 1.0 - (xx + zz), yz - wx),
        (xz - wy, yz + wx, 1.0 - (xx + yy)),
    )


@lru_cache(maxsize=32)
def body_axes_ned(ned_from_body: Quaternion) -> Matrix3:
    """The axes x, y, z of the body in NED. Cached as the matrix is."""
    return transpose(matrix_from_quaternion(ned_from_body))


def quaternion_from_matrix(m: Matrix3) -> Quaternion:
    """The unit quaternion (w >= 0) of a rotation matrix.

    The largest component is computed first (Shepperd's method), so every rotation is well conditioned.
    """
    (a, b, c), (d, e, f), (g, h, i) = m
    squares = (1.0 + a + e + i, 1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i)
    largest = max(range(4), key=squares.__getitem__)
    if largest == 0:
        q = (squares[0], h - f, c - g, d - b)
    elif largest == 1:
        q = (h - f, squares[1], b + d, c + g)
    elif largest == 2:
        q = (c - g, b + d, squares[2], f + h)
    else:
        q = (d - b, c + g, f + h, squares[3])
    w, x, y, z = normalized(q)
    return (w, x, y, z) if w >= 0.0 else (-w, -x, -y, -z)


def rotate(q: Quaternion, v: Vector3) -> Vector3:
    """The vector v of frame a in coordinates of frame b, for q = b_from_a."""
    w, x, y, z = q
    vx, vy, vz = v
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def exp(rotation_vector: Vector3) -> Quaternion:
    """The unit quaternion of a rotation vector, radians: the exponential map of SO(3)."""
    x, y, z = rotation_vector
    angle2 = x * x + y * y + z * z
    if angle2 < 1e-8:  # below 1e-4 rad the next term of the series is under 1e-17
        s = 0.5 - angle2 / 48.0
        return normalized((1.0 - angle2 / 8.0, s * x, s * y, s * z))
    angle = sqrt(angle2)
    s = sin(0.5 * angle) / angle
    return (cos(0.5 * angle), s * x, s * y, s * z)


def log(q: Quaternion) -> Vector3:
    """The rotation vector of a unit quaternion, radians, at most pi long: the logarithm on SO(3)."""
    w, x, y, z = q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
    sine = sqrt(x * x + y * y + z * z)
    s = 2.0 * atan2(sine, w) / sine if sine > 1e-9 else 2.0 / w
    return (s * x, s * y, s * z)


def difference(q_to: Quaternion, q_from: Quaternion) -> Vector3:
    """The rotation vector from ``q_from`` to ``q_to`` in the body frame of ``q_from``: log(q_from^-1 q_to)."""
    return log(multiply(conjugate(q_from), q_to))
