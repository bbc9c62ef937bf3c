"""Elevation models: tiles of height samples, bilinear between samples, with voids and seams, of any file format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, floor, isnan, nan, radians

import msgspec

NEAREST_SAMPLE = 0.26
"""Largest distance, in steps, of a neighbouring tile's sample that replaces a missing sample at a seam."""

MOST_FILLED_M = 90.0
"""Widest hole between two edges that is filled, metres: about three samples of one second of arc."""
METRES_PER_DEGREE = 111_320.0
MOST_KEPT = 100_000
"""Most filled samples that are kept: 20 MB."""

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
    filled_sigma_m: float = 0.0
    """One sigma of the heights where a corner is a void that was filled, metres: the relief of its edges."""

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
        self._filled: dict[tuple[int, int, int], tuple[float, float]] = {}
        """Height and sigma of samples that are voids, by tile, row and column."""

    def height_m(self, lat_deg: float, lon_deg: float) -> float:
        """The height at a place in the datum of the files, metres; NaN outside and in cells with a void."""
        cell = self.cell_at(lat_deg, lon_deg)
        return nan if cell is None else cell.height_m(lat_deg, lon_deg)

    def covers(self, lat_deg: float, lon_deg: float) -> bool:
        """Whether a place lies within a tile, be it a void."""
        for tile in self._tiles:
            row, column = tile.row_column(lat_deg, lon_deg)
            if 0.0 <= row <= tile.rows - 1 and 0.0 <= column <= tile.columns - 1:
                return True
        return False

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
        places = [(i + south, j + east) for south in (0, 1) for east in (0, 1)]
        corners = [self._sample(tile, *place) for place in places]
        sigma = 0.0
        if any(map(isnan, corners)):
            if reach:
                return None
            filled = [
                self._fill(tile, *place) if isnan(height) else (height, 0.0)
                for place, height in zip(places, corners, strict=True)
            ]
            corners, sigma = [height for height, _ in filled], max(each for _, each in filled)
            if any(map(isnan, corners)):
                return None
        north, west = tile.north_deg - i * tile.lat_step_deg, tile.west_deg + j * tile.lon_step_deg
        nw, ne, sw, se = corners
        return Cell(north, west, tile.lat_step_deg, tile.lon_step_deg, nw, ne, sw, se, sigma)

    def _fill(self, tile: ElevationTile, i: int, j: int) -> tuple[float, float]:
        """(height, sigma) of a void by the edges of the hole along its row and its column; NaN where it is too wide.

        The weight of each line is the inverse of the hole's width. The sigma is half the range of the edges and of the
        samples behind them: the local relief.
        """
        key = (id(tile), i, j)
        if key in self._filled:
            return self._filled[key]
        if len(self._filled) >= MOST_KEPT:
            self._filled.clear()
        north_m = tile.lat_step_deg * METRES_PER_DEGREE
        east_m = tile.lon_step_deg * METRES_PER_DEGREE * cos(radians(tile.north_deg - i * tile.lat_step_deg))
        total = weights = 0.0
        edges: list[float] = []
        for step, spacing_m in (((1, 0), north_m), ((0, 1), east_m)):
            before, after = (self._edge(tile, (i, j), step, sign * int(MOST_FILLED_M / spacing_m)) for sign in (-1, 1))
            if before is None or after is None or (before[0] + after[0]) * spacing_m > MOST_FILLED_M + EDGE:
                continue
            width = before[0] + after[0]
            total += (after[0] * before[1][0] + before[0] * after[1][0]) / width / width
            weights += 1.0 / width
            edges += [*before[1], *after[1]]
        answer = (total / weights, 0.5 * (max(edges) - min(edges))) if weights else (nan, nan)
        self._filled[key] = answer
        return answer

    def _edge(
        self, tile: ElevationTile, place: tuple[int, int], step: tuple[int, int], limit: int
    ) -> tuple[int, list[float]] | None:
        """(samples to the edge of the hole, heights of the edge and of the sample behind it) along a line; or None."""
        sign = 1 if limit > 0 else -1
        for count in range(1, abs(limit) + 1):
            heights = [
                self._sample(tile, place[0] + sign * n * step[0], place[1] + sign * n * step[1])
                for n in (count, count + 1)
            ]
            if not isnan(heights[0]):
                return count, [height for height in heights if not isnan(height)]
        return None

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
