"""How far two lenses of one camera are apart: in their rays, where both see."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from fwav_companion.camera.batch import camera_rays_from_pixels
from fwav_companion.tools.calibrate.lens_fit.corners import Floats
from fwav_companion.types import Lens

ACROSS: Final = 41
"""Pixels along each side of the image at which the rays are compared."""


class Apart(msgspec.Struct, frozen=True):
    """Radians."""

    rms: float
    largest: float
    rms_beside_turn: float
    """What is left when one lens is turned to fit the other best, as a mount's calibration would turn it."""


def rays_apart(one: Lens, other: Lens) -> Apart | None:
    """Over the image, evenly; None where no pixel is seen by both. Both are of one image size."""
    width, height = one.image_size
    u, v = np.meshgrid(np.linspace(0.0, width - 1.0, ACROSS), np.linspace(0.0, height - 1.0, ACROSS))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    (ours, seen), (theirs, seen_too) = camera_rays_from_pixels(one, pixels), camera_rays_from_pixels(other, pixels)
    both = seen & seen_too
    if not both.any():
        return None
    ours, theirs = ours[both], theirs[both]
    angles = _angles(ours, theirs)
    u_, _, vt = np.linalg.svd(ours.T @ theirs)
    turn = u_ @ np.diag([1.0, 1.0, np.linalg.det(u_ @ vt)]) @ vt
    return Apart(_rms(angles), float(angles.max()), _rms(_angles(ours, theirs @ turn.T)))


def _angles(one: Floats, other: Floats) -> Floats:
    """(N,) between unit rays; by the sine, which small angles keep."""
    angles: Floats = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1))
    return angles


def _rms(values: Floats) -> float:
    return float(np.sqrt((values**2).mean()))
