"""The lower convex hull: delays are never negative, so that a clock's line lies along it (Zhang, Liu & Xia 2002)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

Point: TypeAlias = tuple[float, float]


def lower_hull(points: Sequence[Point]) -> list[Point]:
    """Lower convex hull of points in the order of their first coordinate (Andrew 1979)."""
    hull: list[Point] = []
    for x, y in points:
        while len(hull) > 1:
            (xa, ya), (xb, yb) = hull[-2], hull[-1]
            if (yb - ya) * (x - xa) < (y - ya) * (xb - xa):
                break
            hull.pop()
        hull.append((x, y))
    return hull
