"""Appearance of a spot of the ground: its key views, and the patch that the geometry predicts from them. PURE."""

from __future__ import annotations

from typing import Final

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from fwav_companion.types.spots import SpotView

Image = NDArray[np.uint8]
Matrix2 = NDArray[np.float64]

HALF_PX: Final = 15
"""Half side of the compared patch, pixels: 31 x 31 have enough texture at 640 x 480, and are flat within 5 degrees."""
MARGIN: Final = 2.2
"""Half side of the kept area around the spot, over :data:`HALF_PX`: a patch that is turned by 45 degrees and shrunk to
0.64 is still inside."""
KEPT_PX: Final = round(HALF_PX * MARGIN)
SCALE_STEP: Final = 1.3
"""Change of scale, of an axis or of both, from which a view is new: resampling further blurs or invents detail."""
TURN_STEP: Final = 0.5
"""Change of direction from which a view is a new one, radians."""
MOST_VIEWS: Final = 12
"""Most key views: the scales of a climb to eight times the height, or a turn by 360 degrees. The first view stays."""


class KeyView(msgspec.Struct, frozen=True):
    """A view of the spot, cut from one picture."""

    pixels: NDArray[np.float32]
    """Square of grey levels with the spot at its middle, to a fraction of a pixel."""
    pixel_from_ground: Matrix2
    """2 x 2, pixels per metre: d(u, v) / d(north, east) at the spot in that picture."""


class Appearance:
    """The key views of one spot, the first from the operator's click."""

    def __init__(self, first: KeyView) -> None:
        self._views = [first]

    def predicted(self, pixel_from_ground: Matrix2) -> NDArray[np.float32]:
        """Square patch of the spot as predicted for a picture with this Jacobian, from the nearest key view."""
        view = min(self._views, key=lambda each: _distortion(pixel_from_ground, each.pixel_from_ground))
        view_from_now = view.pixel_from_ground @ np.linalg.inv(pixel_from_ground)
        there = np.hstack([view_from_now, np.full((2, 1), float(KEPT_PX)) - view_from_now @ np.full((2, 1), HALF_PX)])
        size = (2 * HALF_PX + 1, 2 * HALF_PX + 1)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        warped: NDArray[np.float32] = cv2.warpAffine(
            view.pixels, there, size, flags=flags, borderMode=cv2.BORDER_REFLECT
        )
        return warped

    def add(self, view: KeyView) -> None:
        """Keep the view if it differs from all others; the oldest except the first is removed to make room."""
        if min(_distortion(view.pixel_from_ground, each.pixel_from_ground) for each in self._views) < 1.0:
            return
        self._views.append(view)
        if len(self._views) > MOST_VIEWS:
            del self._views[1]


def cut(picture: Image, at: tuple[float, float], pixel_from_ground: Matrix2) -> KeyView | None:
    """The view around a pixel; None if it extends beyond the picture."""
    height, width = picture.shape
    if not (KEPT_PX <= at[0] <= width - 1 - KEPT_PX and KEPT_PX <= at[1] <= height - 1 - KEPT_PX):
        return None
    side = 2 * KEPT_PX + 1
    pixels = cv2.getRectSubPix(picture, (side, side), at, patchType=cv2.CV_32F)
    return KeyView(pixels, pixel_from_ground)


def jacobian(view: SpotView) -> Matrix2:
    """:attr:`SpotView.pixel_from_ground` as 2 x 2."""
    return np.array(view.pixel_from_ground).reshape(2, 2)


def _distortion(now: Matrix2, then: Matrix2) -> float:
    """Difference of two views by scale and direction; from 1 on, a view is new."""
    now_from_then = now @ np.linalg.inv(then)
    turned, scales, back = np.linalg.svd(now_from_then)
    rotation = turned @ back
    angle = abs(np.arctan2(rotation[1, 0], rotation[0, 0]))
    return float(max(np.abs(np.log(scales)).max() / np.log(SCALE_STEP), angle / TURN_STEP))
