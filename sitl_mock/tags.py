"""AprilTags of the family 36h11 on the ground and on pads: their places, their orientations and their corners."""

from __future__ import annotations

import re
from math import cos, pi, radians, sin
from random import Random
from typing import NamedTuple

from sitl_mock.options import Options
from sitl_mock.rotation import Vector
from sitl_mock.scene import Target
from sitl_mock.target_options import PadTagOptions

FAMILY = "tag36h11"
MODULES = 8
"""Modules along a side of the black square; a tag's size is the side of this square."""
LEAST_MODULE_PX = 2.5
"""Smallest readable module, pixels: smaller ones merge with their neighbours."""
WITH_MARGIN = 10
"""Modules along a side of the board: the black square with a white margin of one module."""
PRINT_CORNERS = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
"""Corners of the black square in its own print, half sides right and down: top left first, clockwise."""
BOARD = WITH_MARGIN / MODULES
"""Side of the board over that of the black square: a tag is read only where its whole board is in the image."""


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

    def at(self, right: float, down: float, _flight_s: float) -> Vector:
        """The same point in NED, metres."""
        return (*self.point(right, down), 0.0)

    @property
    def corners(self) -> tuple[Vector, ...]:
        """NED corners of the black square: top left, top right, bottom right, bottom left of its picture."""
        return tuple(self.at(*corner, 0.0) for corner in PRINT_CORNERS)


class PadTag(NamedTuple):
    """One tag of a landing pad."""

    pad: Target
    printed: PadTagOptions

    @property
    def tag_id(self) -> int:
        """Number in its family."""
        return int(self.printed.label.rpartition(":")[2])

    def at(self, right: float, down: float, flight_s: float) -> Vector:
        """NED of a point in the tag's own print: its centre is (0, 0), the black square's half side 1."""
        half, turn = self.printed.size_m / 2.0, radians(self.printed.yaw_deg)
        up_m, right_m = -half * down, half * right
        forward_m = self.printed.forward_m + up_m * cos(turn) - right_m * sin(turn)
        aside_m = self.printed.right_m + up_m * sin(turn) + right_m * cos(turn)
        return self.pad.on_pad(forward_m, aside_m, flight_s)


AnyTag = GroundTag | PadTag


def pad_tags(scene: list[Target]) -> list[PadTag]:
    """Tags of the scene's pads. ValueError for one of another family: it is detected, but cannot be drawn."""
    found = [PadTag(pad, tag) for pad in scene for tag in pad.tags]
    for tag in found:
        if _number(tag.printed.label) is None:
            raise ValueError(f"{tag.printed.label}: only tags {FAMILY}:ID of a pad can be drawn")
    return found


def tags(options: Options, scene: list[Target]) -> list[GroundTag]:
    """Tags of the scene: targets whose label is ``tag36h11:ID``; their orientations are drawn by the seed."""
    found = []
    for index, target in enumerate(scene):
        number = _number(target.label)
        if number is None or target.tags:
            continue
        if target.walks or target.at(0.0)[2] != 0.0:
            raise ValueError(f"{target.label}: a tag must lie still on the ground")
        heading = Random(f"{options.seed}/tag/{index}").uniform(-pi, pi)
        north, east, _ = target.at(0.0)
        found.append(GroundTag(index, number, (north, east), heading, options.camera.tag_side_m))
    return found


def _number(label: str) -> int | None:
    """Number of a tag of the family by its label; None for another label."""
    match = re.fullmatch(FAMILY + r":(\d+)", label)
    return None if match is None else int(match[1])
