"""Vectors and rotations over leading axes. Every result depends on its own entries alone, whatever the batch.

``einsum`` without ``optimize`` sums each entry in the same order for every batch size; ``matmul`` does not.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
Mask: TypeAlias = npt.NDArray[np.bool_]

SMALL_RAD = 1e-6
"""Below this angle the series of sin(x) / x and (1 - cos(x)) / x^2 are exact to rounding after their first terms."""


def dot(a: Array, b: Array) -> Array:
    """Inner products over the last axis, of three."""
    product = a * b
    return np.asarray(product[..., 0] + product[..., 1] + product[..., 2])


def cross(a: Array, b: Array) -> Array:
    """Cross products over the last axis."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return vectors(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def vectors(x: Array, y: Array, z: Array) -> Array:
    """Vectors along a new last axis; ``x`` has the full shape."""
    out = np.empty((*x.shape, 3))
    out[..., 0], out[..., 1], out[..., 2] = x, y, z
    return out


def times(a: Array, b: Array) -> Array:
    """Products of 3x3 matrices."""
    return np.asarray(np.einsum("...ij,...jk->...ik", a, b))


def turned(a: Array, x: Array) -> Array:
    """Products of 3x3 matrices with vectors."""
    return np.asarray(np.einsum("...ij,...j->...i", a, x))


def turned_back(a: Array, x: Array) -> Array:
    """Products of transposed 3x3 matrices with vectors."""
    return np.asarray(np.einsum("...ji,...j->...i", a, x))


def rotation(vector: Array) -> Array:
    """Rotation matrices of rotation vectors (Rodrigues)."""
    angle2 = dot(vector, vector)
    angle = np.sqrt(angle2)
    large = angle > SMALL_RAD
    safe = np.where(large, angle, 1.0)
    s = np.where(large, np.sin(safe) / safe, 1.0 - angle2 / 6.0)
    h = np.where(large, 2.0 * (np.sin(0.5 * safe) / safe) ** 2, 0.5)
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    out = np.empty((*vector.shape, 3))
    out[..., 0, 0], out[..., 1, 1], out[..., 2, 2] = (
        1.0 - h * (y * y + z * z),
        1.0 - h * (x * x + z * z),
        1.0 - h * (x * x + y * y),
    )
    xy, xz, yz, sx, sy, sz = h * x * y, h * x * z, h * y * z, s * x, s * y, s * z
    out[..., 0, 1], out[..., 1, 0] = xy - sz, xy + sz
    out[..., 0, 2], out[..., 2, 0] = xz + sy, xz - sy
    out[..., 1, 2], out[..., 2, 1] = yz - sx, yz + sx
    return out
