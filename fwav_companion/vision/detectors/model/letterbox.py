"""Fits a picture into a model's input, and maps boxes back to pixels of the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from fwav_companion.vision.images import Pixels

GREY = 114
"""Grey level of the margins: the models of the YOLO family are trained with it."""

Resize = Literal["letterbox", "letterbox_topleft", "stretch"]
"""Margins on both sides, at the right and bottom (topleft), or none (stretch: each axis has its own scale)."""


@dataclass(frozen=True)
class Letterbox:
    """A picture's place in the input of a model.

    In edge coordinates, where 0 is the left edge of the first pixel: ``input = scale * picture + margin``. A resize
    keeps edges, not centres, so the pixel of an edge coordinate x is x - 0.5.
    """

    scale: tuple[float, float]
    margin: tuple[float, float]

    def picture_from_input(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 4) boxes left, top, right, bottom, pixels of the picture, from boxes in edge coordinates of the input."""
        return self.points_from_input(boxes.reshape(-1, 2)).reshape(boxes.shape)

    def points_from_input(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., 2) pixels of the picture, from points in edge coordinates of the input."""
        pixels: NDArray[np.float64] = (points - np.array(self.margin)) / np.array(self.scale) - 0.5
        return pixels


def fit(pixels: Pixels, size: tuple[int, int], resize: Resize) -> tuple[Pixels, Letterbox]:
    """The picture in colour at ``size`` (width, height), and its place there."""
    coloured = cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR) if pixels.ndim == 2 else pixels
    height, width = coloured.shape[:2]
    if resize == "stretch":
        inner = size
    else:
        share = min(size[0] / width, size[1] / height)
        inner = (max(1, round(width * share)), max(1, round(height * share)))
    resized = coloured if inner == (width, height) else cv2.resize(coloured, inner, interpolation=cv2.INTER_LINEAR)
    room = (size[0] - inner[0], size[1] - inner[1])
    left, top = (room[0] // 2, room[1] // 2) if resize == "letterbox" else (0, 0)
    fitted: Pixels = np.full((size[1], size[0], 3), GREY, np.uint8)
    fitted[top : top + inner[1], left : left + inner[0]] = resized
    return fitted, Letterbox((inner[0] / width, inner[1] / height), (float(left), float(top)))
