"""The coordinate systems of tables of poses: WGS84 in degrees, or UTM on WGS84. PURE."""

from __future__ import annotations

import re
from typing import Final

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.geometry.map_grid import (
    FALSE_EASTING_M,
    FALSE_NORTHING_M,
    convergence_deg,
    degrees_from_transverse_mercator,
)

ACCEPTED: Final = "EPSG:4326, EPSG:32601 to 32660 and 32701 to 32760 (UTM on WGS84), or WGS84 UTM 32N"
UTM: Final = re.compile(r"^WGS\s*84\s*(?:/\s*)?UTM\s*(?:zone\s*)?(\d{1,2})\s*([NS])$", re.IGNORECASE)
EPSG: Final = re.compile(r"^EPSG:{1,2}\s*(\d{4,5})$", re.IGNORECASE)
GEOGRAPHIC: Final = (4326, 4979)
"""WGS84 in two and in three dimensions."""


class TableCrs(msgspec.Struct, frozen=True):
    """WGS84 in degrees (x = longitude, y = latitude), or a zone of UTM (x = easting, y = northing)."""

    zone: int | None = None
    south: bool = False

    def degrees(self, x: float, y: float) -> tuple[float, float]:
        """Latitude and longitude. ValueError where the numbers are no place."""
        if self.zone is None:
            if not (abs(y) <= 90.0 and abs(x) <= 180.0):
                raise ValueError("x is the longitude and y the latitude, degrees")
            return y, x
        north = y - (FALSE_NORTHING_M if self.south else 0.0)
        return degrees_from_transverse_mercator(x - FALSE_EASTING_M, north, self.meridian_deg)

    @property
    def meridian_deg(self) -> float:
        """The central meridian of the zone."""
        return 6.0 * (self.zone or 0) - 183.0

    def convergence_deg(self, lat_deg: float, lon_deg: float) -> float:
        """The grid's north, clockwise from true north; 0 for degrees, whose tables count from true north."""
        return 0.0 if self.zone is None else convergence_deg(lat_deg, lon_deg, self.meridian_deg)


def table_crs(text: str) -> TableCrs | None:
    """The coordinate system that a line names; None where it names none that is known."""
    text = text.strip()
    named = UTM.match(text)
    if named:
        return _zone(int(named[1]), south=named[2].upper() == "S")
    coded = EPSG.match(text)
    if coded:
        code = int(coded[1])
        if code in GEOGRAPHIC:
            return TableCrs()
        return _zone(code % 100, south=code // 100 == 327) if code // 100 in (326, 327) else None
    if text.startswith("+proj="):
        return _proj(text)
    return None


def required_crs(text: str) -> TableCrs:
    """The coordinate system of an option. InputFileError names the accepted ones."""
    found = table_crs(text)
    if found is None:
        raise InputFileError(f"--poses-crs {text}: accepted: {ACCEPTED}")
    return found


def _proj(text: str) -> TableCrs | None:
    words = text.split()
    if "+datum=WGS84" not in words and "+ellps=WGS84" not in words:
        return None
    if "+proj=longlat" in words or "+proj=latlong" in words:
        return TableCrs()
    zone = re.search(r"\+zone=(\d{1,2})(?:\s|$)", text)
    return None if "+proj=utm" not in words or zone is None else _zone(int(zone[1]), south="+south" in words)


def _zone(number: int, *, south: bool) -> TableCrs | None:
    return TableCrs(number, south) if 1 <= number <= 60 else None
