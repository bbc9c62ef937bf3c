"""An AprilTag in a frame: its pixels, and whether a detector can read it."""

from __future__ import annotations

from functools import partial
from math import hypot
from typing import NamedTuple

from sitl_mock.camera import MockCamera
from sitl_mock.lens import Pixel
from sitl_mock.tags import BOARD, LEAST_MODULE_PX, MODULES, PRINT_CORNERS, AnyTag

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


def tag_view(camera: MockCamera, tag: AnyTag, row0_s: float, exposure_s: float) -> TagView:
    """View of a tag in the frame whose first row is exposed at ``row0_s``; pixels may lie outside the image."""

    def pixel_at(right: float, down: float, shift_s: float = 0.0) -> Pixel:
        return camera.rolled_pixel(partial(tag.at, right, down), row0_s + shift_s)[0]

    corners = tuple(pixel_at(*corner) for corner in PRINT_CORNERS)
    whole = all(camera.lens.sees(*pixel_at(BOARD * right, BOARD * down)) for right, down in PRINT_CORNERS)
    before, after = (pixel_at(0.0, 0.0, share * exposure_s) for share in (-0.5, 0.5))
    blur_px = hypot(after[0] - before[0], after[1] - before[1])
    module_px = min(_distance(corners[i], corners[i - 1]) for i in range(4)) / MODULES
    usable = whole and module_px >= LEAST_MODULE_PX and blur_px <= MOST_BLUR_MODULES * module_px
    return TagView(tag.tag_id, pixel_at(0.0, 0.0), corners, module_px, blur_px, usable)


def _distance(a: Pixel, b: Pixel) -> float:
    return hypot(a[0] - b[0], a[1] - b[1])
