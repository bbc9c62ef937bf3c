"""A chessboard, which must be seen whole."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from fwav_companion.tools.calibrate.boards.finder import Floats, Found, Grey, refined, spacing_px
from fwav_companion.tools.calibrate.boards.spec import Board

LONGEST_SIDE_PX: Final = 1280
"""Of a picture in which the board is looked for: of twelve megapixels it takes seconds, and finds no more."""
REACH: Final = 0.4
"""Of the distance between two corners: so far around a corner only its own four squares are seen."""


class ChessboardFinder:
    """By OpenCV's two ways: the one by its sectors, which blur and bent lines trouble less, and the older one."""

    def __init__(self, board: Board) -> None:
        self._pattern = (board.across, board.down)
        x, y = np.meshgrid(np.arange(board.across), np.arange(board.down))
        self._places: Floats = np.asarray(np.stack([x.ravel(), y.ravel()], axis=1) * board.side_m, dtype=np.float64)

    def find(self, picture: Grey) -> Found | None:
        """All inner corners, or None."""
        shrink = min(1.0, LONGEST_SIDE_PX / max(picture.shape))
        small: Grey = picture
        if shrink < 1.0:
            resized = cv2.resize(picture, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
            small = np.asarray(resized, dtype=np.uint8)
        found = self._in(small)
        if found is None:
            return None
        pixels = (found + 0.5) * [picture.shape[1] / small.shape[1], picture.shape[0] / small.shape[0]] - 0.5
        return self._places, refined(picture, pixels, REACH * spacing_px(pixels))

    def _in(self, picture: Grey) -> Floats | None:
        found, corners = cv2.findChessboardCornersSB(picture, self._pattern, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
        if not found:
            flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
            found, corners = cv2.findChessboardCorners(picture, self._pattern, flags=flags)
        return np.asarray(corners, dtype=np.float64).reshape(-1, 2) if found else None
