"""Elevation models made up of numbers, about a place in the Alps."""

from math import cos, radians, sin

import numpy as np

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.localization import ElevationTile

STEP = 1.0 / 3600.0
LAT, LON = 47.5, 8.5
PLANE = TangentPlane(Geodetic.from_degrees(LAT, LON, 500.0))


def tile(height, rows=121, columns=121, north=LAT + 60 * STEP, west=LON - 60 * STEP, step=STEP) -> ElevationTile:
    """A tile whose heights are a function of (row, column)."""
    return ElevationTile(north, west, step, step, rows, columns, lambda i, j: float(height(i, j)), "made up")


def from_array(heights: np.ndarray, north: float, west: float, step: float = STEP) -> ElevationTile:
    return ElevationTile(north, west, step, step, *heights.shape, lambda i, j: float(heights[i, j]), "array")


def direction(elevation_deg: float, azimuth_deg: float) -> tuple[float, float, float]:
    e, a = radians(elevation_deg), radians(azimuth_deg)
    return (cos(e) * cos(a), cos(e) * sin(a), sin(e))
