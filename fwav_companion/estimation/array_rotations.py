"""Rotations of many instants at once; instants are the LAST axis of every array.

numpy loops along the last axis: a product of many 3 x 3 matrices in this order costs a tenth of a stack of matrices in
the usual order. Quaternions are (w, x, y, z), unit, ned_from_carrier.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from fwav_companion.estimation.errors import Array


def _bilinear_form(product: Callable[[Array, Array], Array]) -> Array:
    """The matrix (outputs, 16) that applies a bilinear function of two quaternions to their outer product."""
    basis = np.eye(4)
    return np.stack([product(a, b).ravel() for a in basis for b in basis], axis=-1)


def _half_matrix(a: Array, b: Array) -> Array:
    """Symmetric bilinear form whose diagonal (a = b) is the rotation matrix of a; Barfoot 2017, eq. 6.20."""
    scalar, vector, other, other_vector = a[0], a[1:], b[0], b[1:]
    cross = scalar * _cross_matrix(other_vector) + other * _cross_matrix(vector)
    outer = np.outer(vector, other_vector)
    identity = np.eye(3)
    return np.asarray((scalar * other - vector @ other_vector) * identity + outer + outer.T + cross)


def _cross_matrix(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _twice_vector_of_conjugate_product(a: Array, b: Array) -> Array:
    """Twice the vector part of conj(a) b: the body rate, where b is the derivative of a."""
    return np.asarray(2.0 * (a[0] * b[1:] - b[0] * a[1:] - np.cross(a[1:], b[1:])))


_MATRIX_FORM = _bilinear_form(_half_matrix)  # (9, 16)
_RATE_FORM = _bilinear_form(_twice_vector_of_conjugate_product)  # (3, 16)


def matrices(q: Array) -> Array:
    """Rotation matrices (3, 3, N) of unit quaternions (4, N)."""
    return np.asarray((_MATRIX_FORM @ (q[:, None] * q).reshape(16, -1)).reshape(3, 3, -1))


def body_rates(q: Array, derivative: Array) -> Array:
    """Angular rates (3, N) in carrier axes, rad/s, of quaternions (4, N) and their time derivatives (4, N)."""
    return np.asarray(_RATE_FORM @ (q[:, None] * derivative).reshape(16, -1))


def apply(m: Array, v: Array) -> Array:
    """Products (i, N) of matrices (i, j, N) and vectors (j, N), or (i, k, N) for (j, k, N); either N may be 1."""
    return np.asarray(np.einsum("ijn,jn->in" if v.ndim == 2 else "ijn,jkn->ikn", m, v))


def crosses(v: Array, axes: Array) -> Array:
    """Cross products axes x v: (3, k, N) of vectors (3, N) and axes (3, k, N)."""
    x, y, z = v[:, None]
    a, b, c = axes
    out = np.empty((3, axes.shape[1], v.shape[1]))
    out[0], out[1], out[2] = b * z - c * y, c * x - a * z, a * y - b * x
    return out


def rotation_and_jacobian(v: Array) -> tuple[Array, Array]:
    """Exp of a rotation vector (3,), and its left Jacobian: Exp(v + d) = Exp(J d) Exp(v) for small d.

    Barfoot 2017, eq. 7.13 and 7.77. Not to be written to: frames between two solves have the same one.
    """
    return _rotation_and_jacobian(*v.tolist())


@lru_cache(maxsize=8)
def _rotation_and_jacobian(x: float, y: float, z: float) -> tuple[Array, Array]:
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < 1e-4:
        s, c, e = 1.0 - square / 6.0, 0.5, 1.0 / 6.0
    else:
        s, c = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
        e = (1.0 - s) / square
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    k2 = k @ k
    identity = np.eye(3)
    return identity + s * k + c * k2, identity + c * k + e * k2
