"""Where the corners of a pad's tags are on the pad."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np

from fwav_companion.pads.pad_pose import Array
from fwav_companion.types import Pad, PadTag


class PadLayout:
    """A pad's tags in the pad's axes: forward, right, down."""

    def __init__(self, pad: Pad) -> None:
        self.pad = pad
        self.number = {tag.label: number for number, tag in enumerate(pad.tags)}
        """Number of each tag by its label."""
        self.corners = np.array([tag_corners(tag) for tag in pad.tags])
        """(T, 4, 3) corners, from the upper left one of the print, clockwise, metres."""
        self.landing_point = np.array([*pad.landing_offset_m, 0.0])
        """(3,) point to land on, metres."""

    def label(self, number: int) -> str:
        """Label of a tag."""
        return self.pad.tags[number].label

    def centre(self, number: int) -> Array:
        """(3,) centre of a tag, metres."""
        centre: Array = self.corners[number].mean(axis=0)
        return centre


def tag_corners(tag: PadTag) -> Array:
    """(4, 3) corners of a tag on its pad, from the upper left one of its print, clockwise, metres."""
    half, turn = 0.5 * tag.size_m, radians(tag.yaw_deg)
    upright = half * np.array([(1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)])  # forward, right
    turned = upright @ np.array([(cos(turn), sin(turn)), (-sin(turn), cos(turn))])
    return np.column_stack([turned + np.array(tag.at_m), np.zeros(4)])
