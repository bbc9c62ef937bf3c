"""Three-vectors and 3x3 matrices as plain tuples: for single points several times as fast as arrays."""

from __future__ import annotations

from math import sqrt
from typing import TypeAlias

Vector3: TypeAlias = tuple[float, float, float]
Matrix3: TypeAlias = tuple[Vector3, Vector3, Vector3]
"""Three rows."""

ZERO3: Vector3 = (0.0, 0.0, 0.0)
IDENTITY3: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ZERO33: Matrix3 = (ZERO3, ZERO3, ZERO3)


def add(a: Vector3, b: Vector3) -> Vector3:
    """The sum a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector3, b: Vector3) -> Vector3:
    """The difference a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vector3, s: float) -> Vector3:
    """The vector a times the number s."""
    return (a[0] * s, a[1] * s, a[2] * s)


def dot(a: Vector3, b: Vector3) -> float:
    """The inner product of a and b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector3, b: Vector3) -> Vector3:
    """The cross product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a: Vector3) -> float:
    """The Euclidean length of a."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def unit(a: Vector3) -> Vector3:
    """The unit vector a / |a|; ZeroDivisionError for the zero vector, which has no direction."""
    return scale(a, 1.0 / norm(a))


def transform(m: Matrix3, v: Vector3) -> Vector3:
    """The product of the matrix m and the vector v."""
    r0, r1, r2 = m
    x, y, z = v
    return (
        r0[0] * x + r0[1] * y + r0[2] * z,
        r1[0] * x + r1[1] * y + r1[2] * z,
        r2[0] * x + r2[1] * y + r2[2] * z,
    )


def combination(columns: tuple[Vector3, Vector3, Vector3], weights: Vector3) -> Vector3:
    """The sum of three columns, each times its weight: the product of their matrix and the vector of weights."""
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2) = columns
    x, y, z = weights
    return (x * a0 + y * b0 + z * c0, x * a1 + y * b1 + z * c1, x * a2 + y * b2 + z * c2)


def transpose(m: Matrix3) -> Matrix3:
    """The transpose of m; for a rotation matrix it is the inverse."""
    (a, b, c), (d, e, f), (g, h, i) = m
    return ((a, d, g), (b, e, h), (c, f, i))


def multiply(a: Matrix3, b: Matrix3) -> Matrix3:
    """The matrix product of a and b."""
    (b00, b01, b02), (b10, b11, b12), (b20, b21, b22) = b
    (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = a
    return (
        (x0 * b00 + y0 * b10 + z0 * b20, x0 * b01 + y0 * b11 + z0 * b21, x0 * b02 + y0 * b12 + z0 * b22),
        (x1 * b00 + y1 * b10 + z1 * b20, x1 * b01 + y1 * b11 + z1 * b21, x1 * b02 + y1 * b12 + z1 * b22),
        (x2 * b00 + y2 * b10 + z2 * b20, x2 * b01 + y2 * b11 + z2 * b21, x2 * b02 + y2 * b12 + z2 * b22),
    )


def add_matrices(a: Matrix3, b: Matrix3) -> Matrix3:
    """The sum of the matrices a and b."""
    (a00, a01, a02), (a10, a11, a12), (a20, a21, a22) = a
    (b00, b01, b02), (b10, b11, b12), (b20, b21, b22) = b
    return ((a00 + b00, a01 + b01, a02 + b02), (a10 + b10, a11 + b11, a12 + b12), (a20 + b20, a21 + b21, a22 + b22))


def outer(a: Vector3, b: Vector3) -> Matrix3:
    """The outer product a b^T."""
    return (scale(b, a[0]), scale(b, a[1]), scale(b, a[2]))


def larger_semi_axis(m: Matrix3) -> float:
    """One sigma along the longer axis of the horizontal (north, east) error ellipse of the covariance m, metres."""
    nn, ne, ee = m[0][0], m[0][1], m[1][1]
    mean, half = 0.5 * (nn + ee), 0.5 * (nn - ee)
    return sqrt(max(0.0, mean + sqrt(half * half + ne * ne)))
