"""What the vision process is told to do. PURE, and known to both sides of its socket."""

from __future__ import annotations

from typing import Literal

import msgspec


def dictionary_key(name: str) -> str:
    """A marker dictionary's or tag family's name in lower case without OpenCV's prefix: 4x4_50 for DICT_4X4_50."""
    return name.strip().lower().removeprefix("dict_")


class VisionTask(msgspec.Struct, frozen=True):
    """A source and a detector."""

    source: str
    """libcamera:N, /dev/videoN, rtsp://, or the absolute path of a video, a folder or a named pipe."""
    detector: Literal["apriltag", "aruco", "color"] = "apriltag"
    aruco_dictionary: str = "4x4_50"
    color_hue_deg: float = 0.0


class VisionState(msgspec.Struct, frozen=True):
    """How the vision process fares, told in between its frames."""

    vision: Literal["looking", "lost", "ended"]
    why: str = ""
