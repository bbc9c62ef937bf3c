"""The task of the vision process: the [vision] table of the configuration. PURE, shared by both ends of its socket."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

ArucoDictionary: TypeAlias = Annotated[
    str,
    Meta(
        pattern=r"^(4x4|5x5|6x6|7x7)_(50|100|250|1000)$",
        description='"4x4_50" ... "7x7_1000": 4x4, 5x5, 6x6, 7x7 with 50, 100, 250, 1000 markers',
    ),
]
"""Modules along a side, and markers, of an ArUco dictionary of OpenCV."""


def dictionary_key(name: str) -> str:
    """A marker dictionary's or tag family's name in lower case without OpenCV's prefix: 4x4_50 for DICT_4X4_50."""
    return name.strip().lower().removeprefix("dict_")


class VisionTask(msgspec.Struct, frozen=True):
    """[vision]: if present, this service opens a camera and detects targets itself."""

    source: Annotated[str, Meta(min_length=1)] = "libcamera:0"
    """libcamera:N, /dev/videoN, rtsp://, or the path of a video, of a folder or of a named pipe of images with stamps.
    Paths are absolute in a task, and relative to the file in a configuration."""
    detector: Literal["apriltag", "aruco", "color", "onnx"] = "apriltag"
    """Detector of the targets."""
    aruco_dictionary: ArucoDictionary = "4x4_50"
    """Dictionary of ``aruco``: OpenCV's name in lower case. In a configuration also OpenCV's DICT_4X4_50."""
    color_hue_deg: Annotated[float, Meta(ge=-360, le=360)] = 0.0
    """Hue of ``color``, degrees: 0 red, 60 yellow, 120 green, 240 blue."""


class VisionState(msgspec.Struct, frozen=True):
    """State of the vision process, sent between its frames."""

    vision: Literal["looking", "lost", "ended"]
    """Whether frames come, the camera is lost, or the source has ended."""
    why: str = ""
    """Reason of a loss or an end."""
