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
from fwav_companion.localization.elevation import EDGE, METRES_PER_DEGREE, Cell, ElevationModel

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


class RayPlace(msgspec.Struct, frozen=True, gc=False):
    """A point of a ray; the height is in the datum of the model."""

    lat_deg: float
    lon_deg: float
    height_m: float


def first_hit(
    model: ElevationModel, plane: TangentPlane, start_ned: Vector3, direction: Vector3, raised_m: float
) -> Hit | None:
    """The intersection of a unit ray with the model raised by ``raised_m``.

    None where the ray leaves the model or meets a void before it meets the ground.
    """
    found = _walked(model, plane, start_ned, direction, raised_m)
    return found if isinstance(found, Hit) else None


def end_of_cells(
    model: ElevationModel, plane: TangentPlane, start_ned: Vector3, direction: Vector3, raised_m: float
) -> tuple[float, float] | None:
    """Latitude and longitude, degrees, where a ray without an intersection comes to no cell; None: it is too long."""
    found = _walked(model, plane, start_ned, direction, raised_m)
    return None if isinstance(found, Hit) else found


def _walked(
    model: ElevationModel, plane: TangentPlane, start_ned: Vector3, direction: Vector3, raised_m: float
) -> Hit | tuple[float, float] | None:
    here, cells = place_of(plane, start_ned, raised_m), 0
    for piece in range(MOST_PIECES):
        there = place_of(plane, add(start_ned, scale(direction, (piece + 1) * PIECE_M)), raised_m, near=here)
        at = 0.0
        while at < 1.0:
            place = between(here, there, min(1.0, at + NUDGE))
            cell = model.cell_at(*place)
            cells += 1
            if cell is None:
                return place
            if cells > MOST_CELLS:
                return None
            found, end = _cross(cell, here, there, at)
            if found is not None:
                return Hit((piece + found) * PIECE_M, cell, *between(here, there, found))
            at = onward(cell, end, at)
        here = there
    return None


def onward(cell: Cell, end: float, at: float) -> float:
    """The exit from a cell; where the ray is on its edge already, a step out of the margin of its tile.

    Within the margin the tile gives the same cell again: steps of NUDGE alone would take thousands on coarse models.
    """
    if end > at + NUDGE:
        return end
    return at + max(NUDGE, 2.0 * EDGE * cell.lat_step_deg * METRES_PER_DEGREE / PIECE_M)


def place_of(plane: TangentPlane, ned: Vector3, raised_m: float, near: RayPlace | None = None) -> RayPlace:
    """A point of the ray by latitude, longitude and height in the datum of the model.

    ``near``: a point whose longitude differs by less than 180 degrees, also across the antimeridian.
    """
    place = plane.geodetic_from_ned(ned)
    lon_deg = degrees(place.lon) if near is None else _unwrapped(degrees(place.lon), near.lon_deg)
    return RayPlace(degrees(place.lat), lon_deg, place.alt_amsl_m - raised_m)


def _unwrapped(lon_deg: float, near_deg: float) -> float:
    """The longitude plus a multiple of 360 degrees, within 180 degrees of ``near_deg``."""
    return lon_deg - 360.0 * floor((lon_deg - near_deg + 180.0) / 360.0)


def between(here: RayPlace, there: RayPlace, part: float) -> tuple[float, float]:
    """(latitude, longitude) at a part of the way from ``here`` to ``there``, degrees."""
    return (
        here.lat_deg + part * (there.lat_deg - here.lat_deg),
        here.lon_deg + part * (there.lon_deg - here.lon_deg),
    )


def _cross(cell: Cell, here: RayPlace, there: RayPlace, at: float) -> tuple[float | None, float]:
    """(intersection with the cell's surface or None, exit from the cell), as parts of the piece."""
    south, east = cell.fractions(here.lat_deg, here.lon_deg)
    by_south, by_east = _speeds(cell, here, there)
    end = min(1.0, _leaves(south, by_south), _leaves(east, by_east))
    a, b, c, d = cell.polynomial()
    # height above the surface: p + q t + r t^2
    p = here.height_m - (a + b * south + c * east + d * south * east)
    q = there.height_m - here.height_m - (b * by_south + c * by_east + d * (south * by_east + east * by_south))
    r = -d * by_south * by_east
    return _first_descent(p, q, r=r, at=at, end=end), end


def leaves(cell: Cell, here: RayPlace, there: RayPlace) -> float:
    """Exit from the cell, as a part of the piece."""
    south, east = cell.fractions(here.lat_deg, here.lon_deg)
    by_south, by_east = _speeds(cell, here, there)
    return min(_leaves(south, by_south), _leaves(east, by_east))


def _speeds(cell: Cell, here: RayPlace, there: RayPlace) -> tuple[float, float]:
    """Cells that a piece runs to the south and to the east."""
    return (here.lat_deg - there.lat_deg) / cell.lat_step_deg, (there.lon_deg - here.lon_deg) / cell.lon_step_deg


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
