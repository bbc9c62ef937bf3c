"""UTM and MGRS of a place on WGS84 (Karney 2011, series to the sixth order; NGA.STND.0037)."""

from __future__ import annotations

from math import asinh, atan2, atanh, cos, cosh, degrees, floor, hypot, radians, sin, sinh, sqrt, tan
from typing import Final

import msgspec

from fwav_companion.geometry.earth import ECCENTRICITY2, FLATTENING, SEMI_MAJOR_M

SCALE: Final = 0.9996
FALSE_EASTING_M, FALSE_NORTHING_M = 500_000.0, 10_000_000.0
LEAST_LAT_DEG, LARGEST_LAT_DEG = -80.0, 84.0
N: Final = FLATTENING / (2.0 - FLATTENING)
RECTIFYING_M: Final = SEMI_MAJOR_M / (1.0 + N) * (1.0 + N**2 / 4.0 + N**4 / 64.0 + N**6 / 256.0)
ALPHA: Final = (
    N / 2.0 - 2.0 * N**2 / 3.0 + 5.0 * N**3 / 16.0 + 41.0 * N**4 / 180.0 - 127.0 * N**5 / 288.0,
    13.0 * N**2 / 48.0 - 3.0 * N**3 / 5.0 + 557.0 * N**4 / 1440.0 + 281.0 * N**5 / 630.0,
    61.0 * N**3 / 240.0 - 103.0 * N**4 / 140.0 + 15061.0 * N**5 / 26880.0,
    49561.0 * N**4 / 161280.0 - 179.0 * N**5 / 168.0,
    34729.0 * N**5 / 80640.0,
)
BANDS: Final = "CDEFGHJKLMNPQRSTUVWX"
COLUMNS: Final = ("ABCDEFGH", "JKLMNPQR", "STUVWXYZ")
ROWS: Final = ("ABCDEFGHJKLMNPQRSTUV", "FGHJKLMNPQRSTUVABCDE")
SQUARE_M: Final = 100_000
MOST_STEPS: Final = 20
NEAR_M: Final = 1e-6
STEP_DEG: Final = 1e-5
"""Step of the numerical derivatives of the inverse projection."""


class Utm(msgspec.Struct, frozen=True):
    """A place in UTM."""

    zone: int
    band: str
    easting_m: float
    northing_m: float

    def text(self) -> str:
        """Zone, band, easting and northing to a metre."""
        return f"{self.zone}{self.band} {self.easting_m:.0f} {self.northing_m:.0f}"

    def mgrs(self) -> str:
        """The MGRS reference to a metre; it truncates, as the standard does."""
        easting, northing = floor(self.easting_m), floor(self.northing_m)
        column = COLUMNS[(self.zone - 1) % 3][easting // SQUARE_M - 1]
        row = ROWS[(self.zone - 1) % 2][northing // SQUARE_M % 20]
        return f"{self.zone}{self.band} {column}{row} {easting % SQUARE_M:05d} {northing % SQUARE_M:05d}"


def utm_from_degrees(lat_deg: float, lon_deg: float) -> Utm | None:
    """UTM of a place; None near the poles, where it is not defined."""
    if not LEAST_LAT_DEG <= lat_deg < LARGEST_LAT_DEG:
        return None
    lon_deg = (lon_deg + 180.0) % 360.0 - 180.0
    zone = _zone(lat_deg, lon_deg)
    band = BANDS[min(19, floor((lat_deg + 80.0) / 8.0))]
    easting, northing = transverse_mercator(lat_deg, lon_deg, 6.0 * zone - 183.0)
    return Utm(zone, band, easting + FALSE_EASTING_M, northing + (FALSE_NORTHING_M if lat_deg < 0.0 else 0.0))


def transverse_mercator(lat_deg: float, lon_deg: float, meridian_deg: float) -> tuple[float, float]:
    """(east of the meridian, north of the equator) in the projection of UTM, metres."""
    lat, east = radians(lat_deg), radians(lon_deg - meridian_deg)
    e = sqrt(ECCENTRICITY2)
    sigma = sinh(e * atanh(e * tan(lat) / hypot(1.0, tan(lat))))
    conformal = tan(lat) * hypot(1.0, sigma) - sigma * hypot(1.0, tan(lat))
    xi = atan2(conformal, cos(east))
    eta = asinh(sin(east) / hypot(conformal, cos(east)))
    x, y = eta, xi
    for j, alpha in enumerate(ALPHA, start=1):
        x += alpha * cos(2.0 * j * xi) * sinh(2.0 * j * eta)
        y += alpha * sin(2.0 * j * xi) * cosh(2.0 * j * eta)
    return SCALE * RECTIFYING_M * x, SCALE * RECTIFYING_M * y


def convergence_deg(lat_deg: float, lon_deg: float, meridian_deg: float) -> float:
    """Grid north minus true north, clockwise, degrees (on the sphere: within 0.003 degrees inside a zone)."""
    return degrees(atan2(tan(radians(lon_deg - meridian_deg)) * sin(radians(lat_deg)), 1.0))


def _zone(lat_deg: float, lon_deg: float) -> int:
    """The zone, with the exceptions of Norway and Svalbard."""
    zone = int((lon_deg + 180.0) // 6.0) % 60 + 1
    if 56.0 <= lat_deg < 64.0 and 3.0 <= lon_deg < 12.0:
        return 32
    if lat_deg >= 72.0 and 0.0 <= lon_deg < 42.0:
        return 31 + 2 * int((lon_deg + 3.0) // 12.0)
    return zone


def degrees_from_transverse_mercator(east_m: float, north_m: float, meridian_deg: float) -> tuple[float, float]:
    """Latitude and longitude of (east of the meridian, north of the equator): Newton's method, to a micrometre.

    ValueError beyond the projection's zone, where it does not converge.
    """
    lat_deg = degrees(north_m / (SCALE * RECTIFYING_M))
    lon_deg = meridian_deg + degrees(east_m / (SCALE * SEMI_MAJOR_M * max(0.05, cos(radians(lat_deg)))))
    for _ in range(MOST_STEPS):
        if not (abs(lat_deg) < 89.0 and abs(lon_deg - meridian_deg) < 30.0):
            break
        x, y = transverse_mercator(lat_deg, lon_deg, meridian_deg)
        if hypot(east_m - x, north_m - y) < NEAR_M:
            return lat_deg, lon_deg
        x_lat, y_lat = transverse_mercator(lat_deg + STEP_DEG, lon_deg, meridian_deg)
        x_lon, y_lon = transverse_mercator(lat_deg, lon_deg + STEP_DEG, meridian_deg)
        a, b, c, d = (x_lat - x, x_lon - x, y_lat - y, y_lon - y)
        determinant = a * d - b * c
        lat_deg += STEP_DEG * (d * (east_m - x) - b * (north_m - y)) / determinant
        lon_deg += STEP_DEG * (a * (north_m - y) - c * (east_m - x)) / determinant
    raise ValueError("not a place of the projection")
