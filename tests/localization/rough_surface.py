"""A drawn surface with trees and houses, and the places where rays may end on it by a march of its own."""

from __future__ import annotations

import msgspec
import numpy as np
from made_up_terrain import LAT, LON, PLANE, STEP, tile
from true_flights import PRIORS, Scene

from fwav_companion.localization import Datum, ElevationModel, Localizer, TerrainGround
from fwav_companion.types import Bias, GroundFix, TakeOff, TakeOffSource

FINE = STEP / 30.0
"""One metre."""
SIZE = 401
QUIET = msgspec.structs.replace(
    PRIORS,
    bias_sigmas=tuple(
        0.3 if bias is Bias.TERRAIN else sigma for bias, sigma in zip(Bias, PRIORS.bias_sigmas, strict=True)
    ),
)


def surface(rng, objects=150):
    """Heights above level ground: trees, round and up to 9 m high, and houses of 10 m with flat roofs of 6 m."""
    rows, columns = np.mgrid[0:SIZE, 0:SIZE]
    heights = 1.5 * np.sin(rows / 40.0) * np.cos(columns / 55.0)
    for k in range(objects):
        i, j = rng.uniform(0, SIZE, 2)
        if k % 4:
            heights += rng.uniform(4.0, 9.0) * np.exp(
                -((rows - i) ** 2 + (columns - j) ** 2) / (2 * rng.uniform(1.5, 3.0) ** 2)
            )
        else:
            heights = np.where((abs(rows - i) < 5) & (abs(columns - j) < 5), 6.0, heights)
    return heights


def ground_of(heights, lift_m):
    made = tile(lambda i, j: 500.0 + heights[i, j] + lift_m, SIZE, SIZE, LAT + 200 * FINE, LON - 200 * FINE, FINE)
    ground = TerrainGround(ElevationModel([made]), Datum.EGM96)
    ground.on_origin(PLANE, TakeOff(PLANE.origin, TakeOffSource.ASSUMED), None)
    ground.shift = None  # the model's own heights, of which the draw is the error
    return ground


def direction_of(scene):
    sighting = scene.sighting()
    return tuple(np.array(sighting.ned_from_camera) @ np.array(sighting.ray.direction))


NORTH_M, EAST_M = 1.0 / 1.0294, 1.0 / 0.6958
"""Rows and columns in a metre."""
DRAWS = 120
CHI95 = 5.991


def march(heights: np.ndarray, cameras: np.ndarray, rays: np.ndarray, raised: np.ndarray) -> np.ndarray:
    """North and east where each ray first lies below the surface; steps of 0.1 m."""
    at = np.arange(1.0, 200.0, 0.1)
    ends = np.full((len(rays), 2), np.nan)
    for index, (camera, ray, up) in enumerate(zip(cameras, rays, raised, strict=True)):
        points = camera + at[:, None] * ray
        row, column = 200 - points[:, 0] * NORTH_M, 200 + points[:, 1] * EAST_M
        inside = (row > 0) & (row < SIZE - 1) & (column > 0) & (column < SIZE - 1)
        i, j = np.clip(row.astype(int), 0, SIZE - 2), np.clip(column.astype(int), 0, SIZE - 2)
        a, b = row - i, column - j
        level = (
            heights[i, j] * (1 - a) * (1 - b) + heights[i + 1, j] * a * (1 - b)
            + heights[i, j + 1] * (1 - a) * b + heights[i + 1, j + 1] * a * b
        )  # fmt: skip
        below = inside & (-points[:, 2] <= level + up)
        if below.any():
            ends[index] = points[int(np.argmax(below)), :2]
    return ends


def judged_rays(seed: int, flights: int, down_deg: float) -> dict[str, int]:
    """Counts of answered, refused, missed and needlessly refused sights.

    For each drawn sight the places where the true ray may end are drawn with the priors' errors. A sight is missed
    where it has a fix, and more than 15 % of these places lie outside its 95 % ellipse. It is refused needlessly where
    the ellipse of these places about the ray's end holds 90 % of them: then one claim can tell.
    """
    rng = np.random.default_rng(seed)
    heights = surface(rng)
    counts = dict.fromkeys(("answered", "refused", "missed", "needless"), 0)
    while counts["answered"] + counts["refused"] < flights:
        away, bearing = 60.0 / np.tan(np.radians(down_deg)), rng.uniform(0.0, 2.0 * np.pi)
        scene = Scene(
            roll_deg=0.0, pitch_deg=90.0 - down_deg, yaw_deg=np.degrees(bearing), height_m=60.0,
            target=(away * np.cos(bearing), away * np.sin(bearing)), vehicle=tuple(rng.uniform(-60.0, 60.0, 2)),
            pixel_sigma=(2.0, 2.0),
        )  # fmt: skip
        sighting = scene.sighting()
        answer = Localizer(ground_of(heights, 0.0), QUIET, min_height_m=0.5).locate(sighting)
        draws = [scene.draw(rng, QUIET) for _ in range(DRAWS)]
        seen = [scene.sighting(bias, noise) for bias, noise in draws]
        rays = [np.array(each.ned_from_camera) @ np.array(each.ray.direction) for each in seen]
        cameras = np.array([each.camera_ned for each in seen])
        ends = march(heights, cameras, np.array(rays), np.array([bias[Bias.TERRAIN] for bias, _ in draws]))
        middle = march(heights, np.array([sighting.camera_ned]), np.array([direction_of(scene)]), np.zeros(1))[0]
        ends = ends[np.isfinite(ends).all(axis=1)] - middle
        if not np.isfinite(middle).all() or len(ends) < DRAWS // 2:
            continue
        if isinstance(answer, GroundFix):
            cov = np.array(answer.cov)[:2, :2]
            counts["answered"] += 1
            counts["missed"] += np.mean(_squares(ends, cov) > CHI95) > 0.15
        else:
            counts["refused"] += 1
            counts["needless"] += np.mean(_squares(ends, ends.T @ ends / len(ends)) > CHI95) < 0.1
    return {name: int(value) for name, value in counts.items()}


def _squares(ends: np.ndarray, cov: np.ndarray) -> np.ndarray:
    return np.einsum("ni,ij,nj->n", ends, np.linalg.inv(cov), ends)
