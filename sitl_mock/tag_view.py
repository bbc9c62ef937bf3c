"""What a frame has of an AprilTag: its pixels, and whether a detector can read it."""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

from sitl_mock.camera import MockCamera
from sitl_mock.lens import Pixel
from sitl_mock.scene import Target
from sitl_mock.tags import MODULES, GroundTag

LEAST_MODULE_PX = 2.5
"""A module that is smaller in the image than this cannot be told from its neighbour."""
MOST_BLUR_MODULES = 1.2
"""More motion within the exposure than this share of a module, and black and white run together: OpenCV's detector
finds 97 in 100 tags below it, half at 1.7, none beyond 2."""


class TagView(NamedTuple):
    """What a frame has of a tag."""

    tag_id: int
    pixel: Pixel
    """Of its centre, at the instant of the centre's row."""
    corners: tuple[Pixel, ...]
    module_px: float
    """Along the shortest side."""
    blur_px: float
    """The centre's way during the exposure."""
    usable: bool
    """The whole board is in the image, its modules are large enough, and blur leaves them apart."""


def tag_view(camera: MockCamera, scene: list[Target], tag: GroundTag, row0_s: float, exposure_s: float) -> TagView:
    """What the frame whose first row is exposed at ``row0_s`` shows of a tag; pixels outside the image included."""
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
