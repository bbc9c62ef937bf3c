"""A coarse grid over a picture, whose nodes are interpolated to every pixel."""

from __future__ import annotations

from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray

STEP = 8
"""Spacing of the grid's nodes, pixels."""
PAD = 1
"""Nodes beyond the image on each side: the image's edge is interpolated, not extrapolated."""
Window = tuple[slice, slice]
"""Rows and columns of a part of a picture."""


def nodes(pixels: int) -> NDArray[np.float64]:
    """Positions of the nodes along an axis of the image, at the centres of blocks."""
    return (np.arange(ceil(pixels / STEP) + 2 * PAD, dtype=np.float64) - PAD) * STEP + (STEP - 1) / 2.0


def to_pixels(
    grid: NDArray[np.floating], first: tuple[int, int], size: tuple[int, int]
) -> tuple[NDArray[np.float32], Window]:
    """Values at the pixels of a part of the grid, and where in the image of this (width, height) they are.

    ``first``: row and column of the part's first node. The outermost half block has the value of its node.
    """
    rows, columns = grid.shape
    full = cv2.resize(grid.astype(np.float32), (columns * STEP, rows * STEP), interpolation=cv2.INTER_LINEAR)
    top, left = ((node - PAD) * STEP for node in first)
    down, across = (
        slice(max(0, top), min(size[1], top + rows * STEP)),
        slice(max(0, left), min(size[0], left + columns * STEP)),
    )
    part = full[max(0, -top) : max(0, down.stop - top), max(0, -left) : max(0, across.stop - left)]
    return np.ascontiguousarray(part), (down, across)
