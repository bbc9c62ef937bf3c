"""The order in which a detector sends a tag's corners, brought to that of the print: clockwise from its upper left.

A square seen from its front runs clockwise in the image in its own order. Corners that run counterclockwise, or in rows
as the letter Z is written, are recognised by one tag. Which corner comes first is not: a square turned by 90 degrees
has the same corners. Two tags of a pad show it together, because their places then do not fit.
"""

from __future__ import annotations

from typing import Final

from fwav_companion.types import Corners

LEAST_BEND_PX2: Final = 1.0
"""Least cross product of two sides at a corner, square pixels: a square of 24 px seen at 80 degrees has a hundred."""
SHIFTS: Final = (0, 1, 2, 3)
"""Number of corners by which a detector's first corner follows the upper left one, clockwise."""


def clockwise(corners: Corners) -> Corners | None:
    """The corners clockwise in the image, from the same first corner; None for what is no convex quadrilateral."""
    a, b, c, d = corners
    for candidate in (corners, (a, d, c, b), (a, b, d, c), (a, c, d, b), (a, c, b, d), (a, d, b, c)):
        if all(bend > LEAST_BEND_PX2 for bend in _bends(candidate)):
            return candidate
    return None


def _bends(corners: Corners) -> list[float]:
    """The cross product of each side and the next, positive where the corner between them bends clockwise."""
    sides = [
        (after[0] - before[0], after[1] - before[1])
        for before, after in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    return [u * following[1] - v * following[0] for (u, v), following in zip(sides, sides[1:] + sides[:1], strict=True)]
