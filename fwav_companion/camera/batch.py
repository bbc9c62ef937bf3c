"""Rays of many pixels at once, with numpy, for images, lens fits and reports. The daemon never imports this."""

from __future__ import annotations

from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fwav_companion.camera.kannala_brandt import KannalaBrandt
from fwav_companion.types import Lens, NoRay

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]

CHUNK = 8192
"""Pixels per chunk: intermediate results stay in a core's cache, twice as fast as a million pixels at once."""

NODES, MOST_STEPS = 4096, 16
"""Nodes of the starting table, and Newton steps. Exactly at the fold a step only halves the error: from one node's
distance, 5e-4 rad, sixteen steps reach 1e-8 rad."""


def camera_rays_from_pixels(lens: Lens, pixels: Floats) -> tuple[Floats, Flags]:
    """The (N, 3) unit rays of (N, 2) pixels in the camera frame, NaN beyond the valid range; (N,) flags of validity."""
    pixels = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 2)
    rays = np.empty((len(pixels), 3))
    valid = np.ones(len(pixels), dtype=np.bool_)
    if isinstance(lens, KannalaBrandt):
        with np.errstate(over="ignore", invalid="ignore"):  # pixels that are not finite
            for start in range(0, len(pixels), CHUNK):
                part = slice(start, start + CHUNK)
                _fisheye_rays(lens, pixels[part], rays[part], valid[part])
    else:
        _one_by_one(lens, pixels, rays, valid)
    return rays, valid


@lru_cache(maxsize=4)
def _coefficients(lens: KannalaBrandt) -> Floats:
    """The coefficients of the lens's ray table, (8, pieces)."""
    return np.ascontiguousarray(np.array(lens.ray_table.pieces, dtype=np.float64).reshape(-1, 8).T)


def _fisheye_rays(lens: KannalaBrandt, pixels: Floats, rays: Floats, valid: Flags) -> None:
    """Write the rays of one chunk in place, by the ray table where it has pieces. Each temporary array costs time."""
    s0, s1, s2, s3, c0, c1, c2, c3 = _coefficients(lens)
    per_u, per_v = (1.0 / (m * lens.ray_table.unit) for m in lens.pixels_per_mm)
    y = pixels[:, 1] - lens.principal_point[1]
    y *= per_v
    x = pixels[:, 0] - lens.principal_point[0]
    x *= per_u
    if lens.skew:
        x -= lens.skew * y
    rho2 = x * x
    rho2 += y * y
    beyond = ~(rho2 < len(s0))
    outside = np.flatnonzero(beyond) if beyond.any() else None
    if outside is not None:
        kept = x[outside], y[outside]
        rho2[outside] = 0.0
    if len(s0):
        index = rho2.astype(np.intp)
        s = s3.take(index)
        for coefficient in (s2, s1, s0):
            s *= rho2
            s += coefficient.take(index)
        np.multiply(x, s, out=rays[:, 0])
        np.multiply(y, s, out=rays[:, 1])
        c = c3.take(index)
        for coefficient in (c2, c1, c0):
            c *= rho2
            c += coefficient.take(index)
        rays[:, 2] = c
    if outside is not None:
        unit = lens.ray_table.unit
        rays[outside], valid[outside] = _solved_rays(lens, kept[0] * unit, kept[1] * unit)


@lru_cache(maxsize=4)
def _nodes(lens: KannalaBrandt) -> tuple[Floats, Floats]:
    """Angles over the valid range, and their radii."""
    theta = np.linspace(0.0, lens.largest_angle, NODES)
    return theta, _radius_and_slope(lens, theta)[0]


def _solved_rays(lens: KannalaBrandt, x: Floats, y: Floats) -> tuple[Floats, Flags]:
    """The rays of pixels beyond the ray table, near a fold, by Newton between two nodes; and their flags."""
    radius = np.hypot(x, y)
    seen = radius <= lens.largest_radius
    x, y, goal = np.where(seen, x, 0.0), np.where(seen, y, 0.0), np.where(seen, radius, 0.0)
    angles, radii = _nodes(lens)
    theta = np.interp(goal, radii, angles)
    low, high = theta - angles[1], np.minimum(theta + angles[1], lens.largest_angle)
    for _ in range(MOST_STEPS):
        r, slope = _radius_and_slope(lens, theta)
        following = np.clip(theta + (goal - r) / slope, low, high)
        moved = np.abs(following - theta).max(initial=0.0)
        theta = following
        if moved <= 1e-10:
            break
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.where(goal > 0.0, np.sin(theta) / goal, 0.0)
    rays = np.stack([x * s, y * s, np.cos(theta)], axis=1)
    rays[~seen] = np.nan
    return rays, seen


def _radius_and_slope(lens: KannalaBrandt, theta: Floats) -> tuple[Floats, Floats]:
    k1, k2, k3, k4, k5 = lens.k_mm
    t = theta * theta
    return (
        theta * (k1 + t * (k2 + t * (k3 + t * (k4 + t * k5)))),
        k1 + t * (3.0 * k2 + t * (5.0 * k3 + t * (7.0 * k4 + t * 9.0 * k5))),
    )


def _one_by_one(lens: Lens, pixels: Floats, rays: Floats, valid: Flags) -> None:
    """Write the rays of a pinhole's pixels one by one: some 10 us each, no caller has a million of them."""
    for i, (u, v) in enumerate(pixels.tolist()):
        ray = lens.camera_ray_from_pixel(u, v)
        valid[i] = not isinstance(ray, NoRay)
        rays[i] = np.nan if isinstance(ray, NoRay) else ray
