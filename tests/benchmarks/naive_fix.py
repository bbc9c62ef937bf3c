"""One fix with covariance as a plain numpy implementation: the reference for the localizer's speed. Frozen.

It follows the formulas: matrices are arrays, products are @, a cross product is np.cross, the covariance is J S J^T.
The inverse of the lens is Newton; its derivative and those of the ray are analytic. It is tuned neither for speed nor
against it. Do not change it: ratios are comparable over time only while this stays the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DOWN = np.array([0.0, 0.0, 1.0])


@dataclass
class NaiveFix:
    position: Array
    noise_cov: Array
    bias_jacobian: Array
    cov: Array
    relative_cov: Array
    budget: dict[str, float]


def rotation_from_quaternion(q: Array) -> Array:
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def naive_fix(
    ray: Array,
    d_ray: Array,
    q_ned_body: Array,
    body_from_camera: Array,
    rates: Array,
    velocity: Array,
    camera_ned: Array,
    row_fraction: float,
    sigmas: dict[str, float],
    bias_sigmas: Array,
) -> NaiveFix:
    """``ray``: (3,); ``ray_by_pixel``: its derivatives (3, 2) by the pixel; everything else as in the localizer."""
    ned_from_body = rotation_from_quaternion(q_ned_body)
    ned_from_camera = ned_from_body @ body_from_camera
    direction = ned_from_camera @ ray
    height = -camera_ned[2]
    distance = height / direction[2]
    position = camera_ned + distance * direction

    onto_ground = np.eye(3) - np.outer(direction, DOWN) / direction[2]

    def turned_about(axis: Array) -> Array:
        return distance * onto_ground @ np.cross(axis, direction)

    pixel = distance * onto_ground @ ned_from_camera @ d_ray
    body_axes = ned_from_body.T
    roll, pitch, yaw = (turned_about(axis) for axis in body_axes)
    heading = turned_about(DOWN)
    time = turned_about(ned_from_body @ rates) + onto_ground @ velocity
    higher = onto_ground @ -DOWN
    north, east = onto_ground @ np.array([1.0, 0.0, 0.0]), onto_ground @ np.array([0.0, 1.0, 0.0])
    jacobian = np.column_stack(
        [
            *(roll, pitch, heading, -roll, -pitch, -yaw, time, row_fraction * time, higher, north, east, np.zeros(3)),
            onto_ground @ -velocity,
            *(onto_ground @ axis for axis in body_axes),
            np.zeros(3),
        ]
    )

    pixel_cov = pixel @ np.diag([sigmas["u"] ** 2, sigmas["v"] ** 2]) @ pixel.T
    tilt = np.column_stack([roll, pitch])
    attitude_cov = tilt @ np.diag([sigmas["attitude"] ** 2] * 2) @ tilt.T
    heading_cov = np.outer(heading, heading) * sigmas["attitude"] ** 2
    height_cov = np.outer(higher, higher) * sigmas["height"] ** 2
    time_cov = np.outer(time, time) * sigmas["time"] ** 2
    place = np.column_stack([north, east])
    place_cov = place @ place.T * sigmas["place"] ** 2
    level = np.diag([0.0, 0.0, sigmas["height"] ** 2])
    noise_cov = pixel_cov + attitude_cov + heading_cov + height_cov + time_cov + place_cov + level

    bias_cov = jacobian @ np.diag(bias_sigmas**2) @ jacobian.T
    by_place = [9, 10, 12]
    place_bias_cov = jacobian[:, by_place] @ np.diag(bias_sigmas[by_place] ** 2) @ jacobian[:, by_place].T
    cov = noise_cov + bias_cov + np.diag([0.0, 0.0, bias_sigmas[8] ** 2])

    def share(noise: Array, *columns: int) -> float:
        chosen = list(columns)
        part = jacobian[:, chosen] @ np.diag(bias_sigmas[chosen] ** 2) @ jacobian[:, chosen].T
        return float(np.sqrt(np.trace((noise + part)[:2, :2])))

    none = np.zeros((3, 3))
    budget = {
        "pixel": share(pixel_cov),
        "attitude": share(attitude_cov, 0, 1),
        "heading": share(heading_cov, 2),
        "height": share(height_cov, 8),
        "time": share(time_cov, 6, 7),
        "mount": share(none, 3, 4, 5, 13, 14, 15),
        "position": share(place_cov, 9, 10, 12),
        "terrain": share(none, 11),
        "target": share(none, 16),
    }
    return NaiveFix(position, noise_cov, jacobian, cov, cov - place_cov - place_bias_cov, budget)
