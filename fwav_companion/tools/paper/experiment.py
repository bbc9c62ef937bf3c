"""The paper's simulation: one target and 90 samples with the paper's noise, located by its equations.

"Vision-Based Target Localization for a Flapping-Wing Aerial Vehicle" (Dong, Fu, Zhang, He), section IV. Axes are the
paper's own: X forward, Y to the left, metres from the point below the camera. They are left-handed with Z down; the
tests of localization map them to the axes of this package (paper_axes).
"""

from __future__ import annotations

from math import cos, radians, sin
from typing import TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from fwav_companion.camera import KannalaBrandt
from fwav_companion.camera.batch import camera_rays_from_pixels

Floats: TypeAlias = NDArray[np.float64]

BETA = radians(37.0)
HEIGHT_M = 10.0
TARGET_M = (4.0, 3.0)
SAMPLES = 90
ALPHA = 0.125
ONE_MM_PX = 188.0
LENS = KannalaBrandt((3.55, 0.03, 0.0, 0.0, 0.0), (188.0, 188.0), (320.0, 240.0), (20_000, 20_000))
"""The paper's camera without the limits of its frame: noise of a millimetre puts many pixels outside of 640 x 480,
and the paper does not say that it left those out."""


class Noise(msgspec.Struct, frozen=True):
    """One sigma of each of the paper's three errors."""

    beta_deg: float = 0.1
    height_m: float = 0.5
    pixel_px: float = 4.0


def ground_points(pixels: Floats, beta: Floats, height_m: Floats) -> Floats:
    """(..., 2) X and Y in metres of (..., 2) pixels; NaN at and above the horizon, where the tangent is wrong."""
    rays, _ = camera_rays_from_pixels(LENS, pixels.reshape(-1, 2))
    forward, left, axis = np.moveaxis(rays.reshape(*pixels.shape[:-1], 3), -1, 0)
    c, s = np.cos(beta), np.sin(beta)
    down = c * axis - s * forward
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(down > 0.0, height_m / down, np.nan)
    return np.stack([reach * (c * forward + s * axis), reach * left], axis=-1)


def target_pixel(beta: float = BETA) -> tuple[float, float]:
    """The target's pixel in the paper's camera, tilted by beta."""
    (x, y), c, s = TARGET_M, cos(beta), sin(beta)
    found = LENS.pixel_from_camera_point((c * x - s * HEIGHT_M, y, s * x + c * HEIGHT_M))
    if not isinstance(found, tuple):
        raise ValueError("the target is outside the lens")
    return found


def located_samples(rng: np.random.Generator, runs: int, noise: Noise) -> Floats:
    """(runs, 90, 2) X and Y: the paper's experiment, repeated ``runs`` times."""
    shape = (runs, SAMPLES)
    pixels = np.array(target_pixel()) + noise.pixel_px * rng.standard_normal((*shape, 2))
    beta = BETA + radians(noise.beta_deg) * rng.standard_normal(shape)
    return ground_points(pixels, beta, HEIGHT_M + noise.height_m * rng.standard_normal(shape))


def filtered(samples: Floats, start: Floats | float) -> Floats:
    """The paper's filter as written: u_k = alpha x_(k-1) + (1 - alpha) u_(k-1) along axis 1, u_0 = ``start``.

    A rejected sample (NaN) leaves the output unchanged.
    """
    output = np.empty_like(samples)
    u = np.broadcast_to(np.asarray(start, dtype=np.float64), samples[:, 0].shape).copy()
    for k in range(samples.shape[1]):
        output[:, k] = u
        x = samples[:, k]
        u = np.where(np.isnan(x), u, ALPHA * x + (1.0 - ALPHA) * u)
    return output


def averaged(samples: Floats) -> Floats:
    """A Kalman filter of a stationary target: with samples of equal covariance, the mean of all samples so far."""
    seen = ~np.isnan(samples)
    count = np.maximum(np.cumsum(seen, axis=1), 1)
    means: Floats = np.cumsum(np.where(seen, samples, 0.0), axis=1) / count
    return means
