"""Finders of the three kinds of board, in OpenCV, with corners refined in the full picture."""

from __future__ import annotations

from math import sqrt
from typing import Final, Protocol, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from fwav_companion.errors import UserError
from fwav_companion.tools.calibrate.board_spec import CalibrationBoard
from fwav_companion.vision.task import dictionary_key

Grey: TypeAlias = NDArray[np.uint8]
"""Grey picture, (height, width)."""
Floats: TypeAlias = NDArray[np.float64]
FoundCorners: TypeAlias = tuple[Floats, Floats]
"""Corners on the board, (N, 2), metres; the same corners in the picture, (N, 2), pixels."""

SMALLEST_PX: Final = 32
"""Shorter side of a picture, pixels: OpenCV's finders fail on smaller ones, and no board fits in."""
LONGEST_SIDE_PX: Final = 1280
"""Longer side of the picture in which a chessboard is searched: twelve megapixels take seconds and give no more."""
REFINEMENT: Final = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
SMALLEST_WINDOW, LARGEST_WINDOW = 2, 11
"""Limits of the refinement window, pixels from the corner: fewer are noise, more only cost time."""
CHESSBOARD_REACH: Final = 0.4
"""Refinement window of a chessboard corner, in corner distances: only the corner's own four squares are in it."""
CHARUCO_REACH: Final = 0.9
"""Refinement window of a ChArUco corner, in distances to the nearest marker."""
TAG_REACH: Final = 0.8
"""Refinement window of a tag's corner, in modules: the outermost module is black all round."""
TAGS, TAG_MODULES = 587, 8
"""Tags of the family 36h11, and modules along a tag's side."""
WRONG_LAYOUT: Final = 0.25
"""Layout error, as a share of a tag's side, of an AprilGrid whose columns and rows are swapped: in the right layout a
fisheye's bend is smaller, in a wrong one tags are whole steps off."""

MARKER_DICTIONARIES: Final = {
    dictionary_key(name): getattr(cv2.aruco, name) for name in dir(cv2.aruco) if name.startswith("DICT_")
}
"""OpenCV's dictionaries by name, as 4x4_50, apriltag_36h11, aruco_original."""


class BoardFinder(Protocol):
    """A finder of one board."""

    def find(self, picture: Grey) -> FoundCorners | None:
        """The corners that are seen; None where the board is not found."""


def finder_of(board: CalibrationBoard) -> BoardFinder:
    """The finder of this board. UserError where OpenCV has no such board."""
    if board.kind == "charuco":
        return CharucoFinder(board)
    if board.kind == "aprilgrid":
        return AprilgridFinder(board)
    return ChessboardFinder(board)


def opencv_dictionary(name: str) -> int | None:
    """OpenCV's number of a marker dictionary or AprilTag family, as DICT_4X4_50, 4x4_50, 36h11; None for another."""
    key = dictionary_key(name)
    family = f"apriltag_{key.removeprefix('apriltag').removeprefix('tag').removeprefix('_')}"
    return MARKER_DICTIONARIES.get(key, MARKER_DICTIONARIES.get(family))


def spacing_px(pixels: Floats) -> float:
    """The smallest distance between two corners, pixels."""
    apart = np.linalg.norm(pixels[:, None] - pixels[None], axis=-1)
    np.fill_diagonal(apart, np.inf)
    return float(apart.min())


class ChessboardFinder:
    """Finder of a chessboard, which must be seen whole, with its outer squares.

    It tries OpenCV's sector-based method, which is robust to blur and bent lines, and then the older one.
    """

    def __init__(self, board: CalibrationBoard) -> None:
        self._pattern = (board.across, board.down)
        x, y = np.meshgrid(np.arange(board.across), np.arange(board.down))
        self._places: Floats = np.asarray(np.stack([x.ravel(), y.ravel()], axis=1) * board.side_m, dtype=np.float64)

    def find(self, picture: Grey) -> FoundCorners | None:
        """All inner corners, or None."""
        small = at_most(picture, LONGEST_SIDE_PX)
        found = self._corners(small)
        if found is None:
            return None
        pixels = (found + 0.5) * [picture.shape[1] / small.shape[1], picture.shape[0] / small.shape[0]] - 0.5
        return self._places, _refine_corners(picture, pixels, CHESSBOARD_REACH * spacing_px(pixels))

    def _corners(self, picture: Grey) -> Floats | None:
        found, corners = cv2.findChessboardCornersSB(picture, self._pattern, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
        if not found:
            flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
            found, corners = cv2.findChessboardCorners(picture, self._pattern, flags=flags)
        return np.asarray(corners, dtype=np.float64).reshape(-1, 2) if found else None


class CharucoFinder:
    """Finder of a ChArUco board, of which a part is enough: it may extend over the edge of the picture.

    It tries both layouts: boards with an even number of rows were drawn differently before OpenCV 4.6.
    """

    def __init__(self, board: CalibrationBoard) -> None:
        number = opencv_dictionary(board.dictionary)
        if number is None:
            accepted = "a dictionary of OpenCV's, as DICT_4X4_50 or DICT_5X5_100"
            raise UserError(f"--board {board.text!r}: {board.dictionary}: accepted: {accepted}")
        dictionary = cv2.aruco.getPredefinedDictionary(number)
        markers, wanted = len(dictionary.bytesList), board.across * board.down // 2
        if markers < wanted:
            accepted = f"a dictionary with at least {wanted} markers"
            raise UserError(f"--board {board.text!r}: {board.dictionary} has {markers} markers; accepted: {accepted}")
        self._to_marker = CHARUCO_REACH * sqrt(2.0) * (board.side_m - board.second_m) / 2.0 / board.side_m
        self._detectors = []
        for legacy in (False, True):
            size = (board.across, board.down)
            drawn = cv2.aruco.CharucoBoard(size, board.side_m, board.second_m, dictionary)
            drawn.setLegacyPattern(legacy)
            self._places = np.asarray(drawn.getChessboardCorners(), dtype=np.float64)[:, :2]
            self._detectors.append(cv2.aruco.CharucoDetector(drawn))

    def find(self, picture: Grey) -> FoundCorners | None:
        """The corners between markers that are seen; the layout that finds some is tried first from then on."""
        for detector in self._detectors:
            corners, ids, _, _ = detector.detectBoard(picture)
            if ids is None or len(ids) < 2:
                continue
            if detector is not self._detectors[0]:
                self._detectors.reverse()
            pixels = corners.reshape(-1, 2).astype(np.float64)
            return self._places[np.ravel(ids)], _refine_corners(picture, pixels, self._to_marker * spacing_px(pixels))
        return None


class AprilgridFinder:
    """Finder of Kalibr's grid of AprilTags with small black squares between their corners; a part of it is enough.

    The squares join the tags into one dark shape. OpenCV's own quadrangle detector still works on large tags, the
    AprilTag library's, which follows edges, more often on small ones; so both are used. Where a tag's corner meets a
    square, black and white form a saddle like a chessboard's, and there the corner is refined.

    Tags are numbered to the right, row by row. The picture shows which way up rows and tags are: Kalibr counts its rows
    upwards, other programs downwards.
    """

    def __init__(self, board: CalibrationBoard) -> None:
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

    def find(self, picture: Grey) -> FoundCorners | None:
        """The corners of all tags that are seen; None where the tags lie as in a grid with swapped counts."""
        seen: dict[int, Floats] = {}
        for detector in self._detectors:
            quads, ids, _ = detector.detectMarkers(picture)
            for number, quad in zip([] if ids is None else np.ravel(ids).tolist(), quads, strict=True):
                if number < self._board.across * self._board.down:
                    seen.setdefault(number, np.asarray(quad, dtype=np.float64).reshape(4, 2))
        if not seen:
            return None
        reach = TAG_REACH / TAG_MODULES
        pixels = np.concatenate(
            [_refine_corners(picture, quad, reach * _shortest_side(quad)) for quad in seen.values()]
        )
        error, places = _best_layout(self._board, list(seen), pixels)
        if error < WRONG_LAYOUT * min(map(_shortest_side, seen.values())):
            return places, pixels
        swapped_error, _ = _best_layout(self._board.swapped(), list(seen), pixels)
        return None if swapped_error < WRONG_LAYOUT * error else (places, pixels)


def _best_layout(board: CalibrationBoard, numbers: list[int], pixels: Floats) -> tuple[float, Floats]:
    """The median layout error, pixels, and the tags' corners on the board, (4N, 2), of the layout with the least."""
    layouts = [_layout(board, numbers, rows_up, first) for rows_up in (-1.0, 1.0) for first in range(4)]
    errors = [_layout_error(places, pixels) for places in layouts]
    best = int(np.argmin(errors))
    return errors[best], layouts[best]


def _layout(board: CalibrationBoard, numbers: list[int], rows_up: float, first: int) -> Floats:
    """The tags' corners on the board, (4N, 2), from corner ``first`` around; rows count up (-1) or down (1)."""
    side, step = board.side_m, board.side_m + board.second_m
    tag = np.roll(np.array([(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]), first, axis=0)
    rows, columns = np.divmod(numbers, board.across)
    corners: Floats = (np.stack([columns, rows_up * rows], axis=1) * step)[:, None] + tag
    return corners.reshape(-1, 2)


def _layout_error(places: Floats, pixels: Floats) -> float:
    """The median error of a homography, pixels. A fisheye bends the board's image by less than a wrong layout does."""
    h, _ = cv2.findHomography(places, pixels)
    if h is None:
        return float("inf")
    bent = cv2.perspectiveTransform(places[:, None], h)[:, 0] - pixels
    return float(np.median(np.linalg.norm(bent, axis=1)))


def _shortest_side(quad: Floats) -> float:
    return float(np.linalg.norm(np.roll(quad, -1, axis=0) - quad, axis=1).min())


def at_most(picture: Grey, longest_px: int) -> Grey:
    """The picture, reduced where its longer side exceeds ``longest_px`` pixels."""
    shrink = min(1.0, longest_px / max(picture.shape))
    if shrink == 1.0:
        return picture
    return np.asarray(cv2.resize(picture, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _refine_corners(picture: Grey, pixels: Floats, reach_px: float) -> Floats:
    """The corners moved to the saddle of the grey levels around them, at most ``reach_px`` away."""
    half = int(np.clip(reach_px, SMALLEST_WINDOW, LARGEST_WINDOW))
    start = np.ascontiguousarray(pixels, dtype=np.float32).reshape(-1, 1, 2)
    moved: Floats = (
        cv2.cornerSubPix(picture, start, (half, half), (-1, -1), REFINEMENT).reshape(-1, 2).astype(np.float64)
    )
    strayed = np.linalg.norm(moved - pixels, axis=1) > half
    return np.where(strayed[:, None], pixels, moved)
