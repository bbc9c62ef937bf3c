"""Rotations by the thousand, as arrays: the numpy twin of what :mod:`fwav_companion.geometry.rotations` does singly."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]


def skew(v: Floats) -> Floats:
    """(..., 3, 3) of (..., 3): ``skew(v) @ w`` is v x w."""
    zero = np.zeros(v.shape[:-1])
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*v.shape[:-1], 3, 3)


def exp(v: Floats) -> Floats:
    """(..., 3, 3) rotations by |v| radians about v, of (..., 3) vectors."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    once = skew(v)
    sine = np.sinc(angle / np.pi)  # sin(x) / x
    half = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2  # (1 - cos(x)) / x^2
    rotated: Floats = np.eye(3) + sine * once + half * (once @ once)
    return rotated


def log(m: Floats) -> Floats:
    """(..., 3) rotation vectors of (..., 3, 3) rotations, for turns well short of half a circle."""
    vee = 0.5 * np.stack(
        [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], axis=-1
    )
    sine = np.linalg.norm(vee, axis=-1)
    cosine = 0.5 * (np.trace(m, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    turned: Floats = vee * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-12), 1.0)[..., None]
    return turned


def matrices(quaternions: Floats) -> Floats:
    """(..., 3, 3) of (..., 4) unit quaternions (w, x, y, z)."""
    w, vector = quaternions[..., 0, None, None], quaternions[..., 1:]
    once = skew(vector)
    turned: Floats = np.eye(3) + 2.0 * w * once + 2.0 * (once @ once)
    return turned


def transposed(m: Floats) -> Floats:
    """The inverse of rotations."""
    return np.swapaxes(m, -1, -2)


def nearest_rotation(m: Floats) -> Floats:
    """(..., 3, 3): the rotation nearest to a matrix."""
    u, _, vt = np.linalg.svd(m)
    u = u.copy()
    u[..., :, 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    near: Floats = u @ vt
    return near
