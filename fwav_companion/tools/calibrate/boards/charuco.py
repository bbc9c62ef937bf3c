"""A chessboard with markers in its white squares, of which a part is enough: it can go over the edge of the picture."""

from __future__ import annotations

from math import sqrt
from typing import Final

import cv2
import numpy as np

from fwav_companion.errors import UserError
from fwav_companion.tools.calibrate.boards.finder import Found, Grey, refined, spacing_px
from fwav_companion.tools.calibrate.boards.spec import Board

INSIDE: Final = 0.9
"""Of the way from a corner to the nearest marker."""


class CharucoFinder:
    """By OpenCV, in both layouts: boards with an even number of rows were drawn otherwise before its 4.6."""

    def __init__(self, board: Board) -> None:
        number = getattr(cv2.aruco, board.dictionary, None) if board.dictionary.startswith("DICT_") else None
        if number is None:
            raise UserError(
                f"--board {board.text!r}: accepted: a dictionary of OpenCV's, as DICT_4X4_50 or DICT_5X5_100"
            )
        dictionary = cv2.aruco.getPredefinedDictionary(number)
        markers, wanted = len(dictionary.bytesList), board.across * board.down // 2
        if markers < wanted:
            raise UserError(
                f"--board {board.text!r}: {board.dictionary} has {markers} markers; accepted: one with {wanted} or more"
            )
        self._to_marker = INSIDE * sqrt(2.0) * (board.side_m - board.second_m) / 2.0 / board.side_m
        self._detectors = []
        for legacy in (False, True):
            drawn = cv2.aruco.CharucoBoard((board.across, board.down), board.side_m, board.second_m, dictionary)
            drawn.setLegacyPattern(legacy)
            self._places = np.asarray(drawn.getChessboardCorners(), dtype=np.float64)[:, :2]
            self._detectors.append(cv2.aruco.CharucoDetector(drawn))

    def find(self, picture: Grey) -> Found | None:
        """The corners between markers that are seen. The layout that finds something is tried first from then on."""
        for detector in self._detectors:
            corners, ids, _, _ = detector.detectBoard(picture)
            if ids is None or len(ids) < 2:
                continue
            if detector is not self._detectors[0]:
                self._detectors.reverse()
            pixels = corners.reshape(-1, 2).astype(np.float64)
            return self._places[np.ravel(ids)], refined(picture, pixels, self._to_marker * spacing_px(pixels))
        return None
