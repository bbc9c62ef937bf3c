"""AprilTags of the family 36h11 on the ground: which targets are tags, how they lie, where their corners are."""

from __future__ import annotations

import re
from math import cos, hypot, pi, sin
from random import Random
from typing import TYPE_CHECKING, NamedTuple

from sitl_mock.options import Options
from sitl_mock.rotation import Vector
from sitl_mock.scene import Target

if TYPE_CHECKING:
    from sitl_mock.camera import MockCamera, Pixel

FAMILY = "tag36h11"
MODULES = 8
"""Along a side of the black square, which is what a tag's size means."""
WITH_MARGIN = 10
"""Along a side of the board: a module of white all round."""
LEAST_MODULE_PX = 2.5
"""A module that is smaller in the image than this cannot be told from its neighbour."""
MOST_BLUR_MODULES = 1.2
"""More motion within the exposure than this share of a module, and black and white run together: OpenCV's detector
finds 97 in 100 tags below it, half at 1.7, none beyond 2."""


class GroundTag(NamedTuple):
    """One tag, flat on the ground, the image's top toward ``heading``."""

    target: int
    """Index of its target in the scene."""
    tag_id: int
    centre: tuple[float, float]
    """North, east."""
    heading: float
    side_m: float

    def point(self, right: float, down: float) -> tuple[float, float]:
        """(north, east) of a point of the tag's own picture: its centre is (0, 0), the black square's half side 1."""
        half = self.side_m / 2.0
        c, s = cos(self.heading), sin(self.heading)
        return (
            self.centre[0] + half * (-down * c - right * s),
            self.centre[1] + half * (-down * s + right * c),
        )

    @property
    def corners(self) -> tuple[Vector, ...]:
        """NED of the black square's corners: of its picture the top left, top right, bottom right, bottom left."""
        return tuple((*self.point(*at), 0.0) for at in ((-1, -1), (1, -1), (1, 1), (-1, 1)))


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


def tags(options: Options, scene: list[Target]) -> list[GroundTag]:
    """The targets whose label is ``tag36h11:ID``; how they lie is the seed's."""
    found = []
    for index, target in enumerate(scene):
        match = re.fullmatch(FAMILY + r":(\d+)", target.label)
        if match is None:
            continue
        if target.walks or target.at(0.0)[2] != 0.0:
            raise ValueError(f"{target.label}: a tag lies still on the ground")
        heading = Random(f"{options.seed}/tag/{index}").uniform(-pi, pi)
        north, east, _ = target.at(0.0)
        found.append(GroundTag(index, int(match[1]), (north, east), heading, options.camera.tag_side_m))
    return found


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
