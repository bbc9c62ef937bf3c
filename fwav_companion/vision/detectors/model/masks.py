"""Outline of a thing by the mask of a segmentation model."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fwav_companion.vision.detectors.model.boxes import Array

OUTLINE_POINTS: Final = 16
"""Directions in which the mask's farthest pixels are taken. For a circle the error is 2 % of its radius."""


def mask_outline(weights: Array, edges: Array, prototypes: NDArray[np.generic], size: tuple[int, int]) -> Array:
    """(16, 2) convex outline of a mask in edge coordinates of the input; NaN where the mask is empty.

    The mask is where the weighted sum of the prototypes, (32, H, W), exceeds 0 in the box: there its sigmoid is 0.5.
    """
    _, rows, columns = prototypes.shape
    scale = np.array([columns / size[0], rows / size[1]])
    low = np.clip(np.floor(edges[:2] * scale), 0, [columns - 1, rows - 1]).astype(int)
    high = np.clip(np.ceil(edges[2:] * scale), low + 1, [columns, rows]).astype(int)
    part = np.asarray(prototypes[:, low[1] : high[1], low[0] : high[0]], np.float64)
    mask = (np.tensordot(weights, part, 1) > 0.0).astype(np.uint8)
    vs, us = np.nonzero(mask)
    if not len(us):
        return np.full((OUTLINE_POINTS, 2), np.nan)
    corners = np.stack([us, vs], 1)[:, None] + np.array([(0, 0), (1, 0), (1, 1), (0, 1)])  # (M, 4, 2) of each pixel
    hull = cv2.convexHull(corners.reshape(-1, 2).astype(np.float32))[:, 0].astype(np.float64)
    turns = 2.0 * np.pi * np.arange(OUTLINE_POINTS) / OUTLINE_POINTS
    directions = np.stack([np.cos(turns), np.sin(turns)])  # (2, 16)
    outline: Array = (hull[(hull @ directions).argmax(axis=0)] + low) / scale
    return np.clip(outline, edges[:2], edges[2:])
