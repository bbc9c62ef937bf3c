"""Elevation models: tiles of height samples, bilinear between samples, with voids and seams, of any file format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import floor, isnan, nan

import msgspec

NEAREST_SAMPLE = 0.26
"""Largest distance, in steps, of a neighbouring tile's sample that replaces a missing sample at a seam."""

EDGE = 1e-6
"""Margin of a tile, in steps (30 um of 30 m): rounding does not exclude places on the edge."""


class ElevationTile(msgspec.Struct, frozen=True):
    """A lattice of heights over latitude and longitude, degrees; rows run southward, columns eastward."""

    north_deg: float
    """Latitude of the samples of the first row; of a PixelIsArea file half a step inside its edge."""
    west_deg: float
    """Longitude of the samples of the first column."""
    lat_step_deg: float
    """Latitude between rows, positive."""
    lon_step_deg: float
    """Longitude between columns, positive."""
    rows: int
    columns: int
    height_m: Callable[[int, int], float]
    """Height of the sample at (row, column), metres; NaN is a void."""
    name: str
    """Name of the file."""
    datum: str = ""
    """Vertical datum by the file's own coordinate system: egm96, egm2008 or ellipsoid; "" where it states none."""

    def row_column(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """Fractional (row, column) of a place, also across the antimeridian."""
        east = (lon_deg - self.west_deg + 180.0) % 360.0 - 180.0
        return (self.north_deg - lat_deg) / self.lat_step_deg, east / self.lon_step_deg


class Cell(msgspec.Struct, frozen=True, gc=False):
    """The bilinear surface between four neighbouring samples."""

    north_deg: float
    west_deg: float
    lat_step_deg: float
    lon_step_deg: float
    north_west_m: float
    north_east_m: float
    south_west_m: float
    south_east_m: float

    def fractions(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """Fractional (south, east) of a place from the north-west corner, 0 to 1 inside the cell."""
        east = (lon_deg - self.west_deg + 180.0) % 360.0 - 180.0
        return (self.north_deg - lat_deg) / self.lat_step_deg, east / self.lon_step_deg

    def polynomial(self) -> tuple[float, float, float, float]:
        """The coefficients (a, b, c, d) of the height a + b south + c east + d south east."""
        a = self.north_west_m
        b, c = self.south_west_m - a, self.north_east_m - a
        return (a, b, c, self.south_east_m - a - b - c)

    def height_m(self, lat_deg: float, lon_deg: float) -> float:
        """The bilinear height at a place, metres."""
        south, east = self.fractions(lat_deg, lon_deg)
        a, b, c, d = self.polynomial()
        return a + b * south + (c + d * south) * east


class ElevationModel:
    """Adjacent tiles as one surface."""

    def __init__(self, tiles: Sequence[ElevationTile]) -> None:
        self._tiles = tuple(tiles)

    def height_m(self, lat_deg: float, lon_deg: float) -> float:
        """The height at a place in the datum of the files, metres; NaN outside and in cells with a void."""
        cell = self.cell_at(lat_deg, lon_deg)
        return nan if cell is None else cell.height_m(lat_deg, lon_deg)

    def cell_at(self, lat_deg: float, lon_deg: float) -> Cell | None:
        """The cell that contains a place; None outside and where one of its samples is a void."""
        for reach in (0, 1):  # first inside a tile, then in the gap between tiles without shared samples
            margin = reach + EDGE
            for tile in self._tiles:
                row, column = tile.row_column(lat_deg, lon_deg)
                if -margin <= row <= tile.rows - 1 + margin and -margin <= column <= tile.columns - 1 + margin:
                    cell = self._cell(tile, row, column, reach)
                    if cell is not None:
                        return cell
        return None

    def _cell(self, tile: ElevationTile, row: float, column: float, reach: int) -> Cell | None:
        i = max(-reach, min(floor(row), tile.rows - 2 + reach))
        j = max(-reach, min(floor(column), tile.columns - 2 + reach))
        corners = [self._sample(tile, i + south, j + east) for south in (0, 1) for east in (0, 1)]
        if any(map(isnan, corners)):
            return None
        north, west = tile.north_deg - i * tile.lat_step_deg, tile.west_deg + j * tile.lon_step_deg
        return Cell(north, west, tile.lat_step_deg, tile.lon_step_deg, *corners)

    def _sample(self, tile: ElevationTile, i: int, j: int) -> float:
        if 0 <= i < tile.rows and 0 <= j < tile.columns:
            return tile.height_m(i, j)
        lat_deg, lon_deg = tile.north_deg - i * tile.lat_step_deg, tile.west_deg + j * tile.lon_step_deg
        for other in self._tiles:
            row, column = other.row_column(lat_deg, lon_deg)
            k, m = round(row), round(column)
            near = abs(row - k) <= NEAREST_SAMPLE and abs(column - m) <= NEAREST_SAMPLE
            if near and 0 <= k < other.rows and 0 <= m < other.columns:
                return other.height_m(k, m)
        return nan
