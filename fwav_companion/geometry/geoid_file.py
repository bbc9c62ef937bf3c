"""A geoid model in a file of NOAA's format .gtx, as proj-data has egm08_25.gtx: undulations on a regular grid.

Header: latitude and longitude of the south-west sample and the steps as 64-bit floats, rows and columns as 32-bit
integers; then 32-bit floats, rows from the south; all big-endian.
"""

from __future__ import annotations

import struct
from math import floor, isfinite
from typing import Final

HEADER: Final = struct.Struct(">ddddii")
MOST_METRES: Final = 120.0
"""No geoid undulation is larger: -107 m south of India, +86 m at New Guinea."""


class GtxGeoid:
    """Undulations of a .gtx file, bilinear between samples."""

    def __init__(self, content: bytes) -> None:
        """ValueError says what is wrong with the content."""
        if len(content) < HEADER.size:
            raise ValueError(f"{len(content)} bytes; accepted: a .gtx file of a geoid")
        south, west, lat_step, lon_step, rows, columns = HEADER.unpack_from(content)
        steps = (lat_step, lon_step)
        if not all(map(isfinite, (south, west, *steps))) or min(steps) <= 0.0 or min(rows, columns) < 2:
            raise ValueError("its header has no grid; accepted: a .gtx file of a geoid")
        if len(content) != HEADER.size + 4 * rows * columns:
            raise ValueError(f"{len(content)} bytes for {rows} x {columns} samples; accepted: a whole .gtx file")
        self._south, self._west = float(south), float(west)
        self._steps: tuple[float, float] = steps
        self._size: tuple[int, int] = (rows, columns)
        self._content = content

    def undulation_m(self, lat_deg: float, lon_deg: float) -> float | None:
        """The height of the geoid above the ellipsoid, metres; None outside of the grid, and where it has none."""
        rows, columns = self._size
        y = (lat_deg - self._south) / self._steps[0]
        x = (lon_deg - self._west) % 360.0 / self._steps[1]
        around = columns * self._steps[1] >= 360.0 - 1e-6
        if not 0.0 <= y <= rows - 1 or (not around and x > columns - 1):
            return None
        i, j = min(floor(y), rows - 2), floor(x) if around else min(floor(x), columns - 2)
        a, b = y - i, x - j
        corners = [self._sample(i + south, (j + east) % columns) for south in (0, 1) for east in (0, 1)]
        if not all(abs(each) <= MOST_METRES for each in corners):
            return None
        low, high = corners[0] * (1 - b) + corners[1] * b, corners[2] * (1 - b) + corners[3] * b
        return low * (1 - a) + high * a

    def _sample(self, row: int, column: int) -> float:
        (value,) = struct.unpack_from(">f", self._content, HEADER.size + 4 * (row * self._size[1] + column))
        return float(value)
