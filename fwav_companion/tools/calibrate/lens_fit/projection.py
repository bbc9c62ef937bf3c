"""The lens as the fit moves it: nine numbers at most, with all derivatives, for many points at once.

    theta = atan2(hypot(x, y), z),   phi = atan2(y, x)
    r(theta) = c1 theta + c2 theta^3 + ... + cn theta^(2n - 1)        pixels along u
    u = u0 + r cos(phi),   v = v0 + stretch r sin(phi)

Of the file's numbers c_i is pixels_per_mm[0] k_i, and the stretch pixels_per_mm[1] / pixels_per_mm[0]: only these mean
anything.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fwav_companion.tools.calibrate.lens_fit.corners import Floats

U0, V0, STRETCH, RADIAL = 0, 1, 2, 3
"""Where the numbers of a lens stand; the rest is c1, c2, ..."""
NEAREST: Final = 1e-12
"""Of a point's distance: so near to the axis the direction of its image is nobody's business."""


def powers(theta: Floats, count: int) -> tuple[Floats, Floats]:
    """(M, count) theta, theta^3, ... and their derivatives."""
    orders = 2 * np.arange(count) + 1
    even = theta[..., None] ** (2 * np.arange(count))
    return even * theta[..., None], even * orders


def radius(lens: Floats, theta: Floats) -> Floats:
    """R(theta) in pixels."""
    odd, _ = powers(theta, len(lens) - RADIAL)
    r: Floats = odd @ lens[RADIAL:]
    return r


def slope(lens: Floats, theta: Floats) -> Floats:
    """dr/dtheta in pixels."""
    _, even = powers(theta, len(lens) - RADIAL)
    rise: Floats = even @ lens[RADIAL:]
    return rise


def angles_from_axis(points: Floats) -> Floats:
    """(M,) theta of (M, 3) points in the camera frame."""
    theta: Floats = np.arctan2(np.hypot(points[..., 0], points[..., 1]), points[..., 2])
    return theta


def project(lens: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
    """(M, 2) pixels of (M, 3) points in the camera frame; (M, 2, 3) by the point; (M, 2, 3 + n) by the lens."""
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    square = x * x + y * y + z * z
    across = np.hypot(x, y) + NEAREST * np.sqrt(square)
    theta = np.arctan2(across, z)
    odd, even = powers(theta, len(lens) - RADIAL)
    r, rise = odd @ lens[RADIAL:], even @ lens[RADIAL:]
    cosine, sine, stretch = x / across, y / across, lens[STRETCH]
    g = r / across
    outward = rise * z / square - g
    plane = np.stack([np.stack([cosine, sine, -rise * across / square], axis=-1)] * 2, axis=1)
    plane[:, :, :2] *= outward[:, None, None]
    by_point = plane * np.stack([cosine, sine], axis=-1)[:, :, None]
    by_point[:, 0, 0] += g
    by_point[:, 1, 1] += g
    by_point[:, 1] *= stretch
    by_lens = np.zeros((len(points), 2, len(lens)))
    by_lens[:, 0, U0] = by_lens[:, 1, V0] = 1.0
    by_lens[:, 1, STRETCH] = r * sine
    by_lens[:, 0, RADIAL:] = odd * cosine[:, None]
    by_lens[:, 1, RADIAL:] = odd * (stretch * sine)[:, None]
    pixels = np.stack([lens[U0] + r * cosine, lens[V0] + stretch * r * sine], axis=-1)
    return pixels, by_point, by_lens
