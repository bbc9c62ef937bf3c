"""What all finders share: the contract, and corners refined in the full picture."""

from __future__ import annotations

from typing import Final, Protocol, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

Grey: TypeAlias = NDArray[np.uint8]
"""(height, width)."""
Floats: TypeAlias = NDArray[np.float64]
Found: TypeAlias = tuple[Floats, Floats]
"""(N, 2) places on the board, metres; (N, 2) pixels."""

REFINED: Final = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
SMALLEST_WINDOW, LARGEST_WINDOW = 2, 11
"""Pixels from a corner to the edge of what is looked at: fewer are noise, more only cost time."""


SMALLEST_PX: Final = 32
"""A picture's shorter side: OpenCV's finders stumble over less, and no board fits in."""


class Finder(Protocol):
    """Finds one kind of board."""

    def find(self, picture: Grey) -> Found | None:
        """What is seen of the board; None where it is not."""


def spacing_px(pixels: Floats) -> float:
    """From a corner to its nearest neighbour, where they are nearest."""
    apart = np.linalg.norm(pixels[:, None] - pixels[None], axis=-1)
    np.fill_diagonal(apart, np.inf)
    return float(apart.min())


def refined(picture: Grey, pixels: Floats, reach_px: float) -> Floats:
    """Corners moved to the saddle of the grey levels around them, no farther than ``reach_px`` away."""
    half = int(np.clip(reach_px, SMALLEST_WINDOW, LARGEST_WINDOW))
    start = np.ascontiguousarray(pixels, dtype=np.float32).reshape(-1, 1, 2)
    moved: Floats = cv2.cornerSubPix(picture, start, (half, half), (-1, -1), REFINED).reshape(-1, 2).astype(np.float64)
    strayed = np.linalg.norm(moved - pixels, axis=1) > half
    return np.where(strayed[:, None], pixels, moved)
