"""Footprint of a camera on level ground: the rays of the image's corners, intersected with the ground plane. Pure."""

from __future__ import annotations

from math import cos, hypot, radians, sin, tan

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.rotations import Quaternion, rotate
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.ground.views import LatLon

STEEPEST_DEG = 80.0
"""Largest angle of a ray from the nadir: beyond it, the ground is too far to locate a target."""
LEAST_HEIGHT_M = 0.5
CORNERS = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
"""Image corners, right and down, clockwise from the top left."""
WIDEST_DEG = 150.0
"""Largest field of view for which corners of a plane image are drawn; that of a fisheye is limited to it."""


def corner_rays(hfov_deg: float, vfov_deg: float) -> list[Vector3]:
    """Rays of the image's corners in body axes, for a camera that looks down, the image's top toward the nose."""
    right = tan(radians(min(hfov_deg, WIDEST_DEG)) / 2.0)
    down = tan(radians(min(vfov_deg, WIDEST_DEG)) / 2.0)
    return [(-v * down, u * right, 1.0) for u, v in CORNERS]


def footprint(place: Geodetic, height_m: float, ned_from_body: Quaternion, rays: list[Vector3]) -> tuple[LatLon, ...]:
    """Corners on the level ground ``height_m`` below the place; empty below half a metre.

    A ray beyond STEEPEST_DEG is turned down to it, in its own azimuth.
    """
    if height_m < LEAST_HEIGHT_M:
        return ()
    plane = TangentPlane(place)
    reach_m = height_m * tan(radians(STEEPEST_DEG))
    corners = []
    for ray in rays:
        north, east, down = rotate(ned_from_body, ray)
        level = hypot(north, east)
        if level == 0.0:
            north_m = east_m = 0.0
        else:
            steep = down > 0.0 and level / down < tan(radians(STEEPEST_DEG))
            distance_m = height_m * level / down if steep else reach_m
            north_m, east_m = distance_m * north / level, distance_m * east / level
        corner = plane.geodetic_from_ned((north_m, east_m, height_m))
        corners.append((corner.lat_deg, corner.lon_deg))
    return tuple(corners)


def heading_only(heading_deg: float) -> Quaternion:
    """Attitude of a level vehicle with this heading."""
    half = radians(heading_deg) / 2.0
    return (cos(half), 0.0, 0.0, sin(half))
