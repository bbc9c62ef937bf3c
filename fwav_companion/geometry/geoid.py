"""Geoid undulation by bicubic interpolation on a grid of 15 minutes of arc.

h = H + N: height above the ellipsoid = height above the geoid + undulation. Catmull-Rom on EGM96's grid differs from
EGM96 itself by 8 mm rms and 0.14 m at most; bilinear interpolation by 40 mm and 0.85 m.
"""

from __future__ import annotations

import zlib
from array import array
from itertools import accumulate
from math import floor
from operator import add
from sys import byteorder
from typing import Final

ROWS: Final = 721
"""Rows from 90 N to 90 S. The samples lie on the multiples of 15 minutes, not in the middle between them."""
COLUMNS: Final = 1440
"""Columns eastward from Greenwich."""
PER_DEGREE: Final = 4
CENTIMETRES: Final = 100.0
EGM96_SIGMA_M: Final = 0.5
"""One sigma of EGM96 itself over land, metres (Lemoine et al. 1998: 0.5 to 1 m)."""
TWO_GEOIDS_SIGMA_M: Final = 0.6
"""One sigma between heights above EGM96 and above EGM2008, metres: 0.55 rms, 2.3 at the 99th percentile."""


class Geoid:
    """The undulation of a geoid model by latitude and longitude."""

    def __init__(self, packed: bytes) -> None:
        """``packed``: zlib of second differences (along columns, then rows) of centimetres, 16-bit little-endian."""
        differences = array("h", zlib.decompress(packed))
        if byteorder == "big":
            differences.byteswap()
        if len(differences) != ROWS * COLUMNS:
            raise ValueError(f"{len(differences)} samples; accepted: {ROWS} rows of {COLUMNS}")
        self._differences = differences
        self._sums: list[list[int]] = []  # by rows, as far south as one was asked for
        self._rows: dict[int, list[int]] = {}

    def undulation_m(self, lat_deg: float, lon_deg: float) -> float:
        """The height of the geoid above the ellipsoid, metres."""
        y, x = (90.0 - lat_deg) * PER_DEGREE, lon_deg % 360.0 * PER_DEGREE
        row, column = min(floor(y), ROWS - 2), floor(x)
        by_column = _weights(x - column)
        total = 0.0
        for i, weight in enumerate(_weights(y - row), start=row - 1):
            samples = self._row(min(max(i, 0), ROWS - 1))
            total += weight * sum(w * samples[(column - 1 + k) % COLUMNS] for k, w in enumerate(by_column))
        return total / CENTIMETRES

    def _row(self, index: int) -> list[int]:
        """The heights of a row, centimetres."""
        found = self._rows.get(index)
        if found is None:
            while len(self._sums) <= index:
                first = len(self._sums) * COLUMNS
                fresh = self._differences[first : first + COLUMNS]
                self._sums.append(list(map(add, self._sums[-1], fresh)) if self._sums else fresh.tolist())
            found = self._rows[index] = list(accumulate(self._sums[index]))
        return found


def _weights(t: float) -> tuple[float, float, float, float]:
    """The weights of four samples at -1, 0, 1, 2 for the place t in [0, 1] (Catmull & Rom 1974)."""
    square, cube = t * t, t * t * t
    return (
        0.5 * (-t + 2.0 * square - cube),
        0.5 * (2.0 - 5.0 * square + 3.0 * cube),
        0.5 * (t + 4.0 * square - 3.0 * cube),
        0.5 * (cube - square),
    )
