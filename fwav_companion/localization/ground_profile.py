"""Distances at which turned rays meet an elevation model: one walk along the ground below the ray.

In the vertical plane of a ray let e(x) be the angle of the surface point at the ground distance x above the ray. A ray
that is turned up by an angle meets the surface where the running maximum of e first reaches this angle (the horizon of
a height field). So the distribution of the angle error gives that of the distance exactly: an edge that hides ground
behind it is a jump of the distance, and no tree is stepped over, as single turned rays would.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin, tan

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.localization.elevation import ElevationModel
from fwav_companion.localization.ray_search import (
    MOST_CELLS,
    MOST_PIECES,
    NUDGE,
    PIECE_M,
    between,
    leaves,
    onward,
    place_of,
)

BACKWARD_M = 1.0
"""Least start behind the camera's foot for rays that may look backward, metres."""


def turned_distances(
    model: ElevationModel,
    plane: TangentPlane,
    start_ned: Vector3,
    direction: Vector3,
    raised_m: float,
    *,
    turns: Sequence[float],
) -> list[float]:
    """Distances of the first points on the model, for a unit ray turned up by each angle; angles rise.

    The list is shorter than ``turns`` where the walk ends before: at a void, or where the model ends.
    """
    along = hypot(direction[0], direction[1])
    heading = (direction[0] / along, direction[1] / along) if along > 0.0 else (1.0, 0.0)
    elevation = atan2(-direction[2], along)
    from_m = _start_m(model, plane, start_ned, raised_m, elevation + turns[0])
    here = place_of(plane, _moved(start_ned, heading, from_m), raised_m)
    found: list[float] = []
    cells, highest = 0, turns[0] - pi
    last = (highest, from_m, 0.0)  # angle, ground distance and rise of the sample before
    for piece in range(MOST_PIECES):
        to_m = from_m + (piece + 1) * PIECE_M
        there = place_of(plane, _moved(start_ned, heading, to_m), raised_m, near=here)
        at = 0.0
        while at < 1.0:
            cell = model.cell_at(*between(here, there, min(1.0, at + NUDGE)))
            cells += 1
            if cell is None or cells > MOST_CELLS:
                return found
            end = onward(cell, min(1.0, leaves(cell, here, there)), at)
            for part in (at, 0.5 * (at + end), end):
                x = from_m + (piece + part) * PIECE_M
                rise = cell.height_m(*between(here, there, part)) - here.height_m
                angle = atan2(rise, x) - elevation
                sample = (angle, x, rise)
                while len(found) < len(turns) and highest < turns[len(found)] <= angle:
                    found.append(_distance(elevation + turns[len(found)], last, sample))
                highest, last = max(highest, angle), sample
            if len(found) == len(turns):
                return found
            at = end
        here = there
    return found


def _distance(elevation: float, low: tuple[float, float, float], high: tuple[float, float, float]) -> float:
    """The distance at which a ray of this elevation meets the line between two samples of the surface."""
    (_, x0, rise0), (_, x1, rise1) = low, high
    c, s = cos(elevation), sin(elevation)
    across = (x1 - x0) * s - (rise1 - rise0) * c
    part = min(1.0, max(0.0, (rise0 * c - x0 * s) / across)) if across else 1.0
    return hypot(x0 + part * (x1 - x0), rise0 + part * (rise1 - rise0))


def _start_m(model: ElevationModel, plane: TangentPlane, start_ned: Vector3, raised_m: float, lowest: float) -> float:
    """Where the walk begins: at the camera's foot, or behind it where the lowest ray looks backward."""
    if lowest > -0.5 * pi:
        return 0.0
    camera = place_of(plane, start_ned, raised_m)
    cell = model.cell_at(camera.lat_deg, camera.lon_deg)
    height_m = 0.0 if cell is None else camera.height_m - cell.height_m(camera.lat_deg, camera.lon_deg)
    return -max(BACKWARD_M, 2.0 * height_m * tan(min(1.4, -lowest - 0.5 * pi)))


def _moved(start: Vector3, heading: tuple[float, float], by_m: float) -> Vector3:
    return (start[0] + by_m * heading[0], start[1] + by_m * heading[1], start[2])


def turned_up(direction: Vector3, angle: float) -> Vector3:
    """A unit ray turned up by an angle in its vertical plane."""
    along = hypot(direction[0], direction[1])
    north, east = (direction[0] / along, direction[1] / along) if along > 0.0 else (1.0, 0.0)
    elevation = atan2(-direction[2], along) + angle
    return (cos(elevation) * north, cos(elevation) * east, -sin(elevation))


def turned_aside(direction: Vector3, angle: float) -> Vector3:
    """A unit ray turned to the right by an angle, about the axis across it in its vertical plane."""
    along = hypot(direction[0], direction[1])
    north, east = (direction[0] / along, direction[1] / along) if along > 0.0 else (1.0, 0.0)
    c, s = cos(angle), sin(angle)
    return (c * direction[0] - s * east, c * direction[1] + s * north, c * direction[2])
