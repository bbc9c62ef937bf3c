"""The pose of a square from the rays to its four corners, for many frames at once.

The square's own frame is that of a camera straight before it: x to the right of the print, y down the print, z away
from who reads it; on the ground, face up, z is down. A small square seen nearly straight on leaves two poses, tilted
either way; both are refined and the better one is taken.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fwav_companion.tools.shake.turns import Floats, exp, nearest_rotation, skew, transposed

SQUARE: Final = np.array([(-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0)])
"""Corners of a square whose side is 1, in the order of the print."""
STEPS: Final = 8
"""Of Gauss and Newton: from the plane's own solution three are enough, from the other pose some more."""


def pose_of_square(rays: Floats, pixel_from_ray: Floats) -> tuple[Floats, Floats, Floats]:
    """(N, 3, 3) camera_from_tag, (N, 3) its middle in sides of the square, (N,) RMS misfit of the corners in pixels."""
    first, middle = _from_homography(rays)
    sight = middle / np.linalg.norm(middle, axis=1, keepdims=True)
    half_turn = 2.0 * sight[:, :, None] * sight[:, None, :] - np.eye(3)
    second = half_turn @ first @ np.diag([-1.0, -1.0, 1.0])
    one, other = (_refined(start, middle, rays, pixel_from_ray) for start in (first, second))
    better = (one[2] <= other[2])[:, None]
    return (
        np.where(better[:, :, None], one[0], other[0]),
        np.where(better, one[1], other[1]),
        np.where(better[:, 0], one[2], other[2]),
    )


def _from_homography(rays: Floats) -> tuple[Floats, Floats]:
    """The plane's map by its four points, exactly, and the pose nearest to it."""
    x, y = rays[:, :, 0] / rays[:, :, 2], rays[:, :, 1] / rays[:, :, 2]
    a, b = np.broadcast_to(SQUARE[:, 0], x.shape), np.broadcast_to(SQUARE[:, 1], x.shape)
    zero, one = np.zeros_like(x), np.ones_like(x)
    in_x = np.stack([a, b, one, zero, zero, zero, -a * x, -b * x], axis=-1)
    in_y = np.stack([zero, zero, zero, a, b, one, -a * y, -b * y], axis=-1)
    system, right = np.concatenate([in_x, in_y], axis=1), np.concatenate([x, y], axis=1)
    h = np.linalg.solve(system, right[..., None])[..., 0]
    columns = np.concatenate([h, np.ones((len(h), 1))], axis=1).reshape(-1, 3, 3)
    scale = 2.0 / (np.linalg.norm(columns[:, :, 0], axis=1) + np.linalg.norm(columns[:, :, 1], axis=1))
    columns = columns * scale[:, None, None]
    right_of, down_of, middle = columns[:, :, 0], columns[:, :, 1], columns[:, :, 2]
    rotation = nearest_rotation(np.stack([right_of, down_of, np.cross(right_of, down_of)], axis=-1))
    return rotation, middle


def _refined(start: Floats, middle: Floats, rays: Floats, pixel_from_ray: Floats) -> tuple[Floats, Floats, Floats]:
    rotation = start
    for _ in range(STEPS):
        arms = SQUARE @ transposed(rotation)
        residual, by_point = _residual(arms + middle[:, None, :], rays, pixel_from_ray)
        jacobian = np.concatenate([-by_point @ skew(arms), by_point], axis=-1).reshape(len(rays), 8, 6)
        normal = transposed(jacobian) @ jacobian
        normal += 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(6)
        step = -np.linalg.solve(normal, transposed(jacobian) @ residual.reshape(-1, 8, 1))[..., 0]
        rotation, middle = exp(step[:, :3]) @ rotation, middle + step[:, 3:]
    residual, _ = _residual(SQUARE @ transposed(rotation) + middle[:, None, :], rays, pixel_from_ray)
    return rotation, middle, np.sqrt((residual**2).mean(axis=(1, 2)))


def _residual(points: Floats, rays: Floats, pixel_from_ray: Floats) -> tuple[Floats, Floats]:
    """(N, 4, 2) pixels by which points of the camera frame miss their rays, (N, 4, 2, 3) the same by the point."""
    length = np.linalg.norm(points, axis=-1, keepdims=True)
    direction = points / length
    residual = (pixel_from_ray @ (direction - rays)[..., None])[..., 0]
    across = (np.eye(3) - direction[..., :, None] * direction[..., None, :]) / length[..., None]
    return residual, pixel_from_ray @ across
