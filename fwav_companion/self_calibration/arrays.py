"""Vectors and rotations over leading axes. Every result depends on its own entries alone, whatever the batch.

``matmul`` multiplies each matrix of a stack separately, whatever their number.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
Mask: TypeAlias = npt.NDArray[np.bool_]

SKEW: Array = np.array([
    [0, 0, 0, 0, 0, -1, 0, 1, 0],
    [0, 0, 1, 0, 0, 0, -1, 0, 0],
    [0, -1, 0, 1, 0, 0, 0, 0, 0],
], float)  # fmt: skip
"""(3, 9), cross-product matrix of each axis, flattened."""
EYE: Array = np.eye(3)
LEAST2 = 1e-300
"""Least squared angle: sin(x) / x is 1 there, without a division by zero."""


def dot(a: Array, b: Array) -> Array:
    """Inner products over the last axis, of length 3."""
    product = a * b
    return np.asarray(product[..., 0] + product[..., 1] + product[..., 2])


def cross(a: Array, b: Array) -> Array:
    """Cross products over the last axis."""
    return turned(skew(a), b)


def skew(vector: Array) -> Array:
    """Cross-product matrices A of vectors a: A b = a x b, and b' A = (b x a)'."""
    return np.asarray((vector @ SKEW).reshape(*vector.shape, 3))


def times(a: Array, b: Array) -> Array:
    """Products of matrices."""
    return np.asarray(a @ b)


def turned(a: Array, x: Array) -> Array:
    """Products of 3x3 matrices with vectors."""
    return np.asarray((a @ x[..., None])[..., 0])


def turned_back(a: Array, x: Array) -> Array:
    """Products of transposed 3x3 matrices with vectors."""
    return np.asarray((x[..., None, :] @ a)[..., 0, :])


def rotation(vector: Array) -> Array:
    """Rotation matrices of rotation vectors (Rodrigues)."""
    angle = np.sqrt(np.maximum(dot(vector, vector), LEAST2))
    half = np.sin(0.5 * angle) / angle
    turn = skew(vector)
    s, h = (np.sin(angle) / angle)[..., None, None], (2.0 * half * half)[..., None, None]
    return np.asarray(EYE + s * turn + h * (turn @ turn))
