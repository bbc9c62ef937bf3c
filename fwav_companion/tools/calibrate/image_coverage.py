"""Which parts of the image the corners of the boards have covered: what decides how far a calibration holds."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

COLUMNS, ROWS = 6, 4
"""Parts of the image: a board of usual size covers two or three of them."""
MISSING_NAMES: Final = ("upper left", "upper right", "lower left", "lower right")
"""Corners of the image, in which a lens differs most from another."""


class ImageCoverage:
    """The parts of the image with a corner of a board."""

    def __init__(self) -> None:
        self._covered = np.zeros((ROWS, COLUMNS), np.bool_)

    def add(self, pixels: NDArray[np.float64], width: int, height: int) -> None:
        """Count the corners of one view, (N, 2) pixels."""
        columns = np.clip(((pixels[:, 0] + 0.5) * COLUMNS / width).astype(int), 0, COLUMNS - 1)
        rows = np.clip(((pixels[:, 1] + 0.5) * ROWS / height).astype(int), 0, ROWS - 1)
        self._covered[rows, columns] = True

    @property
    def share(self) -> float:
        """Share of the parts that are covered."""
        return float(self._covered.mean())

    def shown(self) -> str:
        """One line: the share, and the corners of the image without a board."""
        corners = (self._covered[0, 0], self._covered[0, -1], self._covered[-1, 0], self._covered[-1, -1])
        missing = [name for name, covered in zip(MISSING_NAMES, corners, strict=True) if not covered]
        without = f", no board in the {', '.join(missing)}" if missing else ""
        return f"{100.0 * self.share:.0f} % of the image covered{without}"
