"""Three models of the earth: WGS84, and the two spheres on which the autopilots define their local frames."""

from __future__ import annotations

from math import acos, asin, atan2, cos, degrees, pi, radians, sin, sqrt
from typing import NamedTuple, Protocol

from sitl_mock.rotation import Vector

EQUATOR_M = 6378137.0
E2 = 6.69437999014132e-3
"""First eccentricity squared of WGS84."""
ARDUPILOT_SPHERE_M = 6378100.0
"""ArduPilot's LATLON_TO_M = 0.011131884502145034 m per 1e-7 degree."""
PX4_SPHERE_M = 6371000.0
"""PX4's CONSTANTS_RADIUS_OF_EARTH."""


class Place(NamedTuple):
    """Latitude and longitude in degrees, altitude above mean sea level in metres."""

    lat: float
    lon: float
    alt_amsl: float


class World:
    """Local NED about an origin on the take-off ground: horizontal by WGS84 at its height, down by altitude."""

    def __init__(self, origin: Place) -> None:
        self.origin = origin
        self._lat, self._lon = radians(origin.lat), radians(origin.lon)
        self._ecef = _ecef(self._lat, self._lon, origin.alt_amsl)

    def ned(self, place: Place) -> Vector:
        """(north, east, down) of a place, metres; its altitude does not affect north and east."""
        x, y, z = _ecef(radians(place.lat), radians(place.lon), self.origin.alt_amsl)
        dx, dy, dz = x - self._ecef[0], y - self._ecef[1], z - self._ecef[2]
        sa, ca, so, co = sin(self._lat), cos(self._lat), sin(self._lon), cos(self._lon)
        return (
            -sa * co * dx - sa * so * dy + ca * dz,
            -so * dx + co * dy,
            self.origin.alt_amsl - place.alt_amsl,
        )

    def place(self, ned: Vector) -> Place:
        """Place of a point in NED: a spherical first guess, corrected by iterating :meth:`ned`."""
        height = self.origin.alt_amsl
        w = sqrt(1.0 - E2 * sin(self._lat) ** 2)
        meridian_m = EQUATOR_M * (1.0 - E2) / w**3 + height
        parallel_m = (EQUATOR_M / w + height) * cos(self._lat)
        lat, lon = self.origin.lat, self.origin.lon
        for _ in range(4):
            north, east, _down = self.ned(Place(lat, lon, height))
            lat += degrees((ned[0] - north) / meridian_m)
            lon += degrees((ned[1] - east) / parallel_m)
        return Place(lat, (lon + 180.0) % 360.0 - 180.0, height - ned[2])


class LocalProjection(Protocol):
    """The autopilot's local frame about its EKF origin."""

    origin: Place

    def local(self, place: Place) -> Vector:
        """(x north, y east, z down) of a place, metres."""

    def place(self, local: Vector) -> Place:
        """Place of (x, y, z)."""


class ArduPilotProjection:
    """ArduPilot's projection: degrees scaled by one radius; longitude by the cosine of the mean latitude."""

    def __init__(self, origin: Place) -> None:
        self.origin = origin

    def local(self, place: Place) -> Vector:
        """(x, y, z) of a place, metres."""
        east_degrees = (place.lon - self.origin.lon + 180.0) % 360.0 - 180.0
        scale = cos(radians((place.lat + self.origin.lat) / 2.0))
        return (
            ARDUPILOT_SPHERE_M * radians(place.lat - self.origin.lat),
            ARDUPILOT_SPHERE_M * radians(east_degrees) * scale,
            self.origin.alt_amsl - place.alt_amsl,
        )

    def place(self, local: Vector) -> Place:
        """Place of (x, y, z)."""
        lat = self.origin.lat + degrees(local[0] / ARDUPILOT_SPHERE_M)
        scale = cos(radians((lat + self.origin.lat) / 2.0))
        lon = self.origin.lon + degrees(local[1] / ARDUPILOT_SPHERE_M / scale)
        return Place(lat, (lon + 180.0) % 360.0 - 180.0, self.origin.alt_amsl - local[2])


class Px4Projection:
    """PX4's projection: azimuthal equidistant on a sphere."""

    def __init__(self, origin: Place) -> None:
        self.origin = origin

    def local(self, place: Place) -> Vector:
        """(x, y, z) of a place, metres."""
        lat0, lat = radians(self.origin.lat), radians(place.lat)
        east = radians(place.lon - self.origin.lon)
        arc = acos(max(-1.0, min(1.0, sin(lat0) * sin(lat) + cos(lat0) * cos(lat) * cos(east))))
        k = PX4_SPHERE_M * (arc / sin(arc) if arc > 1e-12 else 1.0)
        return (
            k * (cos(lat0) * sin(lat) - sin(lat0) * cos(lat) * cos(east)),
            k * cos(lat) * sin(east),
            self.origin.alt_amsl - place.alt_amsl,
        )

    def place(self, local: Vector) -> Place:
        """Place of (x, y, z)."""
        x, y = local[0] / PX4_SPHERE_M, local[1] / PX4_SPHERE_M
        arc = sqrt(x * x + y * y)
        if arc < 1e-15:
            return Place(self.origin.lat, self.origin.lon, self.origin.alt_amsl - local[2])
        lat0 = radians(self.origin.lat)
        lat = asin(max(-1.0, min(1.0, cos(arc) * sin(lat0) + x * sin(arc) * cos(lat0) / arc)))
        east = atan2(y * sin(arc), arc * cos(lat0) * cos(arc) - x * sin(lat0) * sin(arc))
        lon = (radians(self.origin.lon) + east + pi) % (2.0 * pi) - pi
        return Place(degrees(lat), degrees(lon), self.origin.alt_amsl - local[2])


def _ecef(lat: float, lon: float, height: float) -> Vector:
    n = EQUATOR_M / sqrt(1.0 - E2 * sin(lat) ** 2)
    return (
        (n + height) * cos(lat) * cos(lon),
        (n + height) * cos(lat) * sin(lon),
        (n * (1.0 - E2) + height) * sin(lat),
    )
