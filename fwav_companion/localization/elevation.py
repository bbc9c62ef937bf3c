"""Elevation models: tiles of samples, bilinear between them, with voids and seams, whatever file they come from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import floor, isnan, nan

import msgspec

NEAREST_SAMPLE = 0.26
"""Of a step: a neighbour's sample that stands in for one of ours at a seam lies on the same lattice, or nearly."""

EDGE = 1e-6
"""Of a step, 30 um: rounding keeps no place on a model's own edge out of it."""


class ElevationTile(msgspec.Struct, frozen=True):
    """A lattice of heights in degrees of latitude and longitude. Rows run southward, columns eastward."""

    north_deg: float
    """Latitude of the first row's samples themselves: half a step inside the edge of a PixelIsArea file."""
    west_deg: float
    """Longitude of the first column's samples."""
    lat_step_deg: float
    """Positive."""
    lon_step_deg: float
    rows: int
    columns: int
    height_m: Callable[[int, int], float]
    """Of (row, column) inside the tile; NaN is a void."""
    name: str

    def row_column(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """Where a place lies on the lattice, as fractions; right across the antimeridian too."""
        east = (lon_deg - self.west_deg + 180.0) % 360.0 - 180.0
        return (self.north_deg - lat_deg) / self.lat_step_deg, east / self.lon_step_deg


class Cell(msgspec.Struct, frozen=True, gc=False):
    """Four neighbouring samples and the bilinear surface between them."""

    north_deg: float
    west_deg: float
    lat_step_deg: float
    lon_step_deg: float
    north_west_m: float
    north_east_m: float
    south_west_m: float
    south_east_m: float

    def fractions(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """(southward, eastward), each 0 to 1 inside."""
        east = (lon_deg - self.west_deg + 180.0) % 360.0 - 180.0
        return (self.north_deg - lat_deg) / self.lat_step_deg, east / self.lon_step_deg

    def polynomial(self) -> tuple[float, float, float, float]:
        """(a, b, c, d) of the height a + b south + c east + d south east."""
        a = self.north_west_m
        b, c = self.south_west_m - a, self.north_east_m - a
        return (a, b, c, self.south_east_m - a - b - c)

    def height_m(self, lat_deg: float, lon_deg: float) -> float:
        """Bilinear."""
        south, east = self.fractions(lat_deg, lon_deg)
        a, b, c, d = self.polynomial()
        return a + b * south + (c + d * south) * east


class ElevationModel:
    """Tiles side by side, as one surface."""

    def __init__(self, tiles: Sequence[ElevationTile]) -> None:
        self._tiles = tuple(tiles)

    def height_m(self, lat_deg: float, lon_deg: float) -> float:
        """As the files have it; NaN outside and where a void takes part."""
        cell = self.cell_at(lat_deg, lon_deg)
        return nan if cell is None else cell.height_m(lat_deg, lon_deg)

    def cell_at(self, lat_deg: float, lon_deg: float) -> Cell | None:
        """The cell that holds a place; None outside and where one of its samples is a void."""
        for reach in (0, 1):  # inside a tile first; then in the gap between neighbours that share no samples
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
