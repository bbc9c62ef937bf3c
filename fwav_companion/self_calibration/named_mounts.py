"""Description of a wrong mount in words for users: a turned or mirrored image, or the angles of the right mount."""

from __future__ import annotations

from math import acos, degrees, radians
from typing import TypeAlias

import numpy as np

from fwav_companion.geometry.mounts import euler_from_body_from_camera
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.self_calibration.arrays import Array, times

Turn: TypeAlias = tuple[int, int, int, int]
"""(a, b, c, d) of a linear map of the camera's ray: x' = a x + b y, y' = c x + d y."""

CANDIDATES: tuple[tuple[str, Turn], ...] = (
    ("the image is upside down: turn the mount by 180 degrees about the camera's axis", (-1, 0, 0, -1)),
    ("the image is turned by 90 degrees counterclockwise", (0, -1, 1, 0)),
    ("the image is turned by 90 degrees clockwise", (0, 1, -1, 0)),
    ("the image is mirrored left to right", (-1, 0, 0, 1)),
    ("the image is mirrored top to bottom", (1, 0, 0, -1)),
)
"""Each mistake in words, with the map that corrects it."""

NAMED = radians(12.0)
"""Mount error, rad, above which a mount is reported as a mistake. Of mounts off by 10 degrees self-calibration found
all, of those off by 15 degrees nine in ten, of those off by 20 degrees half."""


def named(configured: Array, found: Array) -> str:
    """The mistake of the ``configured`` mount in words, by the one that was ``found``; empty where it is off by little.

    A turned image with a mount a little off is still reported as a turned image.
    """
    off = angle(configured, found)
    if off < NAMED:
        return ""
    for text, turn in CANDIDATES:
        if not _mirrors(turn) and angle(turned(configured, turn), found) < NAMED:
            return text
    matrix: Matrix3 = tuple(map(tuple, found.tolist()))  # type: ignore[assignment]
    roll, pitch, yaw = (round(degrees(each)) for each in euler_from_body_from_camera(matrix))
    return (
        f"it is off by about {degrees(off):.0f} degrees: what is seen meets in one place with about "
        f"roll_deg = {roll}, pitch_deg = {pitch}, yaw_deg = {yaw}"
    )


def angle(a: Array, b: Array) -> float:
    """Angle of the rotation from one mount to the other, rad."""
    return acos(max(-1.0, min(1.0, 0.5 * (float((a * b).sum()) - 1.0))))


def turned(mount: Array, turn: Turn) -> Array:
    """The mount (3, 3) with the camera's ray mapped by ``turn``; not a rotation for a mirrored image."""
    a, b, c, d = turn
    return times(mount, np.array(((a, b, 0.0), (c, d, 0.0), (0.0, 0.0, 1.0))))


def _mirrors(turn: Turn) -> bool:
    a, b, c, d = turn
    return a * d < b * c
