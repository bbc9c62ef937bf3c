"""What a mount other than the configured one is called, for people: a turned or mirrored image, or its angles."""

from __future__ import annotations

from math import acos, degrees, radians
from typing import TypeAlias

import numpy as np

from fwav_companion.geometry.mounts import euler_from_body_from_camera
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.self_calibration.arrays import Array, times

Turn: TypeAlias = tuple[int, int, int, int]
"""x' = a x + b y, y' = c x + d y of the camera's ray."""

CANDIDATES: tuple[tuple[str, Turn], ...] = (
    ("the image is upside down: turn the mount by 180 degrees about the camera's axis", (-1, 0, 0, -1)),
    ("the image is turned by 90 degrees counterclockwise", (0, -1, 1, 0)),
    ("the image is turned by 90 degrees clockwise", (0, 1, -1, 0)),
    ("the image is mirrored left to right", (-1, 0, 0, 1)),
    ("the image is mirrored top to bottom", (1, 0, 0, -1)),
)
"""The mistake, and the turn that corrects it."""

NAMED = radians(12.0)
"""A mount off by more is named. Of mounts off by 10 degrees self-calibration found all, of those off by 15 nine in ten,
by 20 half."""


def named(configured: Array, found: Array) -> str:
    """The mistake of a mount in words; empty where it is off by little. A turned image on a mount a little off is still
    a turned image.
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
    """The mount (3, 3) of the camera whose image is turned so; of a mirrored one it is no rotation."""
    a, b, c, d = turn
    return times(mount, np.array(((a, b, 0.0), (c, d, 0.0), (0.0, 0.0, 1.0))))


def _mirrors(turn: Turn) -> bool:
    a, b, c, d = turn
    return a * d < b * c
