"""The mock's surface as an elevation model of one sample a metre, as a drone's own survey makes it."""

from __future__ import annotations

from functools import cache
from math import cos, radians

from fwav_companion.localization import ElevationTile
from sitl_mock import Simulation
from sitl_mock.earth import Place

HALF = 160
"""Samples from the flight centre to each side."""
METRE_DEG = 1.0 / 111_200.0


def surface_tile(mock: Simulation, error_m: float = 0.0) -> ElevationTile:
    """The elevation model of a flight, ``error_m`` too high."""
    north, east = mock.options.flight.centre
    middle = mock.world.place((north, east, 0.0))
    east_deg = METRE_DEG / cos(radians(middle.lat))

    @cache
    def height_m(row: int, column: int) -> float:
        place = Place(middle.lat + (HALF - row) * METRE_DEG, middle.lon + (column - HALF) * east_deg, 0.0)
        n, e, _ = mock.world.ned(place)
        return mock.world.origin.alt_amsl + mock.surface.height_m(n, e) + error_m

    side = 2 * HALF + 1
    return ElevationTile(
        middle.lat + HALF * METRE_DEG, middle.lon - HALF * east_deg, METRE_DEG, east_deg, side, side, height_m, "survey"
    )
