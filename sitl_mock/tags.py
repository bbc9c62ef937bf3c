"""AprilTags of the family 36h11 on the ground: which targets are tags, their orientations and their corners."""

from __future__ import annotations

import re
from math import cos, pi, sin
from random import Random
from typing import NamedTuple

from sitl_mock.options import Options
from sitl_mock.rotation import Vector
from sitl_mock.scene import Target

FAMILY = "tag36h11"
MODULES = 8
"""Modules along a side of the black square; a tag's size is the side of this square."""
LEAST_MODULE_PX = 2.5
"""Smallest readable module, pixels: smaller ones merge with their neighbours."""
WITH_MARGIN = 10
"""Modules along a side of the board: the black square with a white margin of one module."""


class GroundTag(NamedTuple):
    """One tag, flat on the ground, the top of its picture toward ``heading``."""

    target: int
    """Index of its target in the scene."""
    tag_id: int
    centre: tuple[float, float]
    """Centre: north, east."""
    heading: float
    side_m: float

    def point(self, right: float, down: float) -> tuple[float, float]:
        """(north, east) of a point in the tag's own picture: its centre is (0, 0), the black square's half side 1."""
        half = self.side_m / 2.0
        c, s = cos(self.heading), sin(self.heading)
        return (
            self.centre[0] + half * (-down * c - right * s),
            self.centre[1] + half * (-down * s + right * c),
        )

    @property
    def corners(self) -> tuple[Vector, ...]:
        """NED corners of the black square: top left, top right, bottom right, bottom left of its picture."""
        return tuple((*self.point(*at), 0.0) for at in ((-1, -1), (1, -1), (1, 1), (-1, 1)))


def tags(options: Options, scene: list[Target]) -> list[GroundTag]:
    """Tags of the scene: targets whose label is ``tag36h11:ID``; their orientations are drawn by the seed."""
    found = []
    for index, target in enumerate(scene):
        match = re.fullmatch(FAMILY + r":(\d+)", target.label)
        if match is None:
            continue
        if target.walks or target.at(0.0)[2] != 0.0:
            raise ValueError(f"{target.label}: a tag must lie still on the ground")
        heading = Random(f"{options.seed}/tag/{index}").uniform(-pi, pi)
        north, east, _ = target.at(0.0)
        found.append(GroundTag(index, int(match[1]), (north, east), heading, options.camera.tag_side_m))
    return found
