"""Well-spread views of a board among the many of a video: by place, size and tilt. PURE.

A video shows the board in hundreds of similar poses. Each costs time, adds little, and weighs the poses where the hand
rested. As in ROS's camera_calibration, two views are as far apart as place, size and tilt together differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardView

MOST_VIEWS: Final = 40
"""Most views of a video that are used; 15 to 30 pictures are enough where a person chooses them."""
FEWEST_VIEWS: Final = 15
"""Number of views up to which near ones are used too."""
NEAR: Final = 0.1
"""Distance within which two views show nearly the same: a tenth of the image, or half of what ROS asks for."""
SIGHTS: Final = 5
"""Numbers that describe a view: place (2), size, tilt (2)."""


def spread_out(views: Sequence[BoardView], size: tuple[int, int]) -> list[int]:
    """Indices of the views that lie farthest apart, the largest first: each next one is the farthest from those taken.

    ``size``: width and height of the image.
    """
    if not views:
        return []
    sights = np.array([sight_of(view, size) for view in views])  # (V, SIGHTS)
    taken = [int(sights[:, 2].argmax())]
    distance = np.abs(sights - sights[taken[0]]).sum(axis=1)  # (V,) to the nearest taken one
    while len(taken) < min(MOST_VIEWS, len(views)):
        farthest = int(distance.argmax())
        if distance[farthest] < NEAR and len(taken) >= FEWEST_VIEWS:
            break
        taken.append(farthest)
        distance = np.minimum(distance, np.abs(sights - sights[farthest]).sum(axis=1))
        distance[taken] = 0.0
    return taken


def sight_of(view: BoardView, size: tuple[int, int]) -> NDArray[np.float64]:
    """(SIGHTS) place and size of the corners as shares of the image, and how the depth changes across the board."""
    image = np.array(size, np.float64)
    middle = view.pixels.mean(axis=0) / image
    hull = cv2.convexHull(view.pixels.astype(np.float32))
    share = np.sqrt(cv2.contourArea(hull) / image.prod())
    centre = view.board.mean(axis=0)
    half = np.abs(view.board - centre).max()
    homography, _ = cv2.findHomography((view.board - centre) / half, view.pixels / image.max())
    tilt = np.zeros(2) if homography is None else homography[2, :2] / homography[2, 2]
    return np.array([*middle, share, *np.clip(tilt, -1.0, 1.0)])
