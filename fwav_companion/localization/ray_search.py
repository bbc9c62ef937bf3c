"""The first intersection of a ray with an elevation model: cell by cell and exact in each cell.

In one cell the height of a straight ray above the bilinear surface is a quadratic in the distance along the ray. The
first root is the intersection, so the search does not step over narrow ridges. Heights along the ray are those of the
flat local world: the earth's curvature, 0.08 m at 1 km, is neglected here as in the fix.
"""

from __future__ import annotations

from math import degrees, floor, sqrt

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.vectors import Vector3, add, scale
from fwav_companion.localization.elevation import Cell, ElevationModel

PIECE_M = 200.0
"""Length of the pieces of the ray, metres; latitude and longitude are exact at their ends, linear between to 1 mm."""
MOST_PIECES = 50
"""Most pieces of one ray: 10 km, farther than a small vehicle locates targets."""
MOST_CELLS = 4096
"""Most cells of one ray, 10 ms on a desktop; a ray of 10 km over samples 30 m apart crosses 500."""
NUDGE = 1e-9
"""Step into the next cell, as a part of a piece: 0.2 um."""


class Hit(msgspec.Struct, frozen=True, gc=False):
    """The first point of the ray on the surface."""

    distance_m: float
    """Distance along the ray, metres."""
    cell: Cell
    """Cell of the point."""
    lat_deg: float
    lon_deg: float


class _RayPlace(msgspec.Struct, frozen=True, gc=False):
    lat_deg: float
    lon_deg: float
    height_m: float


def first_hit(
    model: ElevationModel, plane: TangentPlane, start_ned: Vector3, direction: Vector3, raised_m: float
) -> Hit | None:
    """The intersection of a unit ray with the model raised by ``raised_m``.

    None where the ray leaves the model or meets a void before it meets the ground.
    """
    here, cells = _place(plane, start_ned, raised_m), 0
    for piece in range(MOST_PIECES):
        there = _place(plane, add(start_ned, scale(direction, (piece + 1) * PIECE_M)), raised_m)
        there = msgspec.structs.replace(there, lon_deg=_unwrapped(there.lon_deg, here.lon_deg))
        at = 0.0
        while at < 1.0:
            cell = model.cell_at(*_between(here, there, min(1.0, at + NUDGE)))
            cells += 1
            if cell is None or cells > MOST_CELLS:
                return None
            found, leaves = _cross(cell, here, there, at)
            if found is not None:
                return Hit((piece + found) * PIECE_M, cell, *_between(here, there, found))
            at = max(leaves, at + NUDGE)
        here = there
    return None


def _place(plane: TangentPlane, ned: Vector3, raised_m: float) -> _RayPlace:
    """A point of the ray by latitude, longitude and height in the datum of the model."""
    place = plane.geodetic_from_ned(ned)
    return _RayPlace(degrees(place.lat), degrees(place.lon), place.alt_amsl_m - raised_m)


def _unwrapped(lon_deg: float, near_deg: float) -> float:
    """The longitude plus a multiple of 360 degrees, within 180 degrees of ``near_deg``."""
    return lon_deg - 360.0 * floor((lon_deg - near_deg + 180.0) / 360.0)


def _between(here: _RayPlace, there: _RayPlace, part: float) -> tuple[float, float]:
    """(latitude, longitude) at a part of the way from ``here`` to ``there``, degrees."""
    return (
        here.lat_deg + part * (there.lat_deg - here.lat_deg),
        here.lon_deg + part * (there.lon_deg - here.lon_deg),
    )


def _cross(cell: Cell, here: _RayPlace, there: _RayPlace, at: float) -> tuple[float | None, float]:
    """(intersection with the cell's surface or None, exit from the cell), as parts of the piece."""
    south, east = cell.fractions(here.lat_deg, here.lon_deg)
    by_south = -(there.lat_deg - here.lat_deg) / cell.lat_step_deg
    by_east = (there.lon_deg - here.lon_deg) / cell.lon_step_deg
    leaves = min(1.0, _leaves(south, by_south), _leaves(east, by_east))
    a, b, c, d = cell.polynomial()
    # height above the surface: p + q t + r t^2
    p = here.height_m - (a + b * south + c * east + d * south * east)
    q = there.height_m - here.height_m - (b * by_south + c * by_east + d * (south * by_east + east * by_south))
    r = -d * by_south * by_east
    return _first_descent(p, q, r=r, at=at, end=leaves), leaves


def _leaves(start: float, speed: float) -> float:
    """The t at which start + speed t leaves [0, 1]."""
    if speed == 0.0:
        return 1.0
    return ((1.0 if speed > 0.0 else 0.0) - start) / speed


def _first_descent(p: float, q: float, r: float, at: float, end: float) -> float | None:
    """The first t in [at, end] with p + q t + r t^2 <= 0, without cancellation; None where there is none."""
    if p + at * (q + at * r) <= 0.0:
        return at
    if r == 0.0:
        roots: tuple[float, ...] = (-p / q,) if q else ()
    else:
        square = q * q - 4.0 * p * r
        if square < 0.0:
            return None
        far = -0.5 * (q + (sqrt(square) if q >= 0.0 else -sqrt(square)))
        roots = (far / r, p / far) if far else (0.0,)
    return min((t for t in roots if at <= t <= end), default=None)
