"""Kalibr's grid of AprilTags with small black squares between their corners; a part of it is enough.

The squares join the tags into one dark shape. In large tags OpenCV's own way finds the quadrangles nevertheless, in
small ones more often the AprilTag library's, which follows the edges; so both are asked. Where a tag's corner meets a
square, black and white form a saddle like a chessboard's, and there the corner is refined.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from fwav_companion.errors import UserError
from fwav_companion.tools.calibrate.boards.finder import Floats, Found, Grey, refined
from fwav_companion.tools.calibrate.boards.spec import Board

TAGS: Final = 587
"""Of the family 36h11."""
MODULES: Final = 8
"""Of a tag's side: the window of a corner ends within the outermost, which is black all round."""
INSIDE: Final = 0.8
UP: Final = (-1.0, 1.0)
"""Kalibr counts its rows upwards, other programs downwards."""


class AprilgridFinder:
    """Tags are numbered to the right, row by row. Which way up rows and tags are, the picture tells."""

    def __init__(self, board: Board) -> None:
        if board.across * board.down > TAGS:
            raise UserError(f"--board {board.text!r}: accepted: at most the {TAGS} tags of 36h11")
        self._board = board
        self._detectors = []
        for way in (cv2.aruco.CORNER_REFINE_NONE, cv2.aruco.CORNER_REFINE_APRILTAG):
            detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
            parameters = detector.getDetectorParameters()
            parameters.cornerRefinementMethod = way
            detector.setDetectorParameters(parameters)
            self._detectors.append(detector)

    def find(self, picture: Grey) -> Found | None:
        """The corners of all tags that are seen."""
        seen: dict[int, Floats] = {}
        for detector in self._detectors:
            quads, ids, _ = detector.detectMarkers(picture)
            for number, quad in zip([] if ids is None else np.ravel(ids).tolist(), quads, strict=True):
                if number < self._board.across * self._board.down:
                    seen.setdefault(number, np.asarray(quad, dtype=np.float64).reshape(4, 2))
        if not seen:
            return None
        reach = INSIDE / MODULES
        pixels = np.concatenate([refined(picture, quad, reach * _shortest_side(quad)) for quad in seen.values()])
        layouts = (self._places(list(seen), up, first) for up in UP for first in range(4))
        return min(layouts, key=lambda places: _misfit(places, pixels)), pixels

    def _places(self, numbers: list[int], up: float, first: int) -> Floats:
        """(4N, 2) of the tags' corners: from corner ``first`` around, rows counted upwards (-1) or downwards (1)."""
        side, step = self._board.side_m, self._board.side_m + self._board.second_m
        tag = np.roll(np.array([(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]), first, axis=0)
        rows, columns = np.divmod(numbers, self._board.across)
        corners: Floats = (np.stack([columns, up * rows], axis=1) * step)[:, None] + tag
        return corners.reshape(-1, 2)


def _misfit(places: Floats, pixels: Floats) -> float:
    """Of a plane's straight image. A fisheye bends it by less than a wrong layout does."""
    h, _ = cv2.findHomography(places, pixels)
    if h is None:
        return float("inf")
    bent = cv2.perspectiveTransform(places[:, None], h)[:, 0] - pixels
    return float(np.median(np.linalg.norm(bent, axis=1)))


def _shortest_side(quad: Floats) -> float:
    return float(np.linalg.norm(np.roll(quad, -1, axis=0) - quad, axis=1).min())
