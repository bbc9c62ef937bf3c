"""An AprilTag in a frame: its pixels, and whether a detector can read it."""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

from sitl_mock.camera import MockCamera
from sitl_mock.lens import Pixel
from sitl_mock.scene import Target
from sitl_mock.tags import LEAST_MODULE_PX, MODULES, GroundTag

MOST_BLUR_MODULES = 1.2
"""Largest readable motion during the exposure, modules; beyond it black and white mix: OpenCV's detector finds 97 in
100 tags below it, half at 1.7, none beyond 2."""


class TagView(NamedTuple):
    """A tag as one frame shows it."""

    tag_id: int
    pixel: Pixel
    """Pixel of its centre, at the instant of the centre's row."""
    corners: tuple[Pixel, ...]
    module_px: float
    """Module size along the shortest side, pixels."""
    blur_px: float
    """Motion of the centre during the exposure, pixels."""
    usable: bool
    """Whether the whole board is in the image, its modules are large enough, and blur leaves them distinct."""


def tag_view(camera: MockCamera, scene: list[Target], tag: GroundTag, row0_s: float, exposure_s: float) -> TagView:
    """View of a tag in the frame whose first row is exposed at ``row0_s``; pixels may lie outside the image."""
    target = scene[tag.target]
    pixel, _ = camera.true_pixel(target, row0_s)
    corners = tuple(camera.pixel_of(corner, row0_s) for corner in tag.corners)
    edges = [tag.point(*at) for at in ((-1.25, -1.25), (1.25, -1.25), (1.25, 1.25), (-1.25, 1.25))]
    whole = all(camera.lens.sees(*camera.pixel_of((*edge, 0.0), row0_s)) for edge in edges)
    before, _ = camera.true_pixel(target, row0_s - exposure_s / 2.0)
    after, _ = camera.true_pixel(target, row0_s + exposure_s / 2.0)
    blur_px = hypot(after[0] - before[0], after[1] - before[1])
    module_px = min(_distance(corners[i], corners[i - 1]) for i in range(4)) / MODULES
    usable = whole and module_px >= LEAST_MODULE_PX and blur_px <= MOST_BLUR_MODULES * module_px
    return TagView(tag.tag_id, pixel, corners, module_px, blur_px, usable)


def _distance(a: Pixel, b: Pixel) -> float:
    return hypot(a[0] - b[0], a[1] - b[1])
