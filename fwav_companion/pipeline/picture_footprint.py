"""Where the border of a picture meets the ground. Pure."""

from __future__ import annotations

from collections.abc import Callable

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types import GroundFix

BORDER = ((-0.5, -0.5), (0.0, -0.5), (0.5, -0.5), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5), (-0.5, 0.5), (-0.5, 0.0))
"""Corners and middles of the border, right and down, as shares of the image."""
BORDER_SHARES = (0.99, 0.8, 0.6, 0.4)
"""Shares of the way from the centre to the border that are tried; the border itself may count as outside."""


def footprint(size: tuple[int, int], located: Callable[[float, float], GroundFix | None]) -> list[Vector3]:
    """Places of the border of a picture, NED, clockwise from its top left. ``located``: the ground at a pixel.

    A pixel without ground is replaced by one nearer to the centre, or left out. Empty if fewer than three are left.
    """
    places = []
    for right, down in BORDER:
        for share in BORDER_SHARES:
            fix = located((0.5 + share * right) * size[0] - 0.5, (0.5 + share * down) * size[1] - 0.5)
            if fix is not None:
                places.append(fix.position_ned)
                break
    return places if len(places) > 2 else []
