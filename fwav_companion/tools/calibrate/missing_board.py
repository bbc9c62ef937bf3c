"""Why the board was not found in a picture. Each reason has its evidence in the picture."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from math import ceil
from typing import Final

import cv2
import msgspec
import numpy as np

from fwav_companion.errors import UserError
from fwav_companion.tools.calibrate.board_finders import (
    LONGEST_SIDE_PX,
    MARKER_DICTIONARIES,
    SMALLEST_PX,
    BoardFinder,
    Floats,
    Grey,
    at_most,
    finder_of,
    opencv_dictionary,
    spacing_px,
)
from fwav_companion.tools.calibrate.board_spec import CalibrationBoard

BLURRED_PX: Final = 5.5
"""Width of the sharper edges of a blurred picture, pixels. Sharp edges are 3.1 wide. Markers of 36 px become
unreadable at a blur of 2.5 to 3 px (one sigma; edges of 5.8 to 6.5) or a motion of 11 px (6.8)."""
SHARPER_PERCENT: Final = 25
"""Percentile that is the width of a picture's edges: a blurred background does not make the picture blurred."""
EDGE_REACH_PX: Final = 12
EDGE_CONTRAST: Final = 40
"""An edge is a rise by at least this many grey levels within EDGE_REACH_PX to both sides, pixels."""
FEWEST_EDGES: Final = 30
"""Edge pixels of one direction from which a width is taken."""
ENLARGEMENT: Final = 3.0
"""Factor of the enlarged picture: a board that is found only there is too small. It finds squares of 2.8 px."""
SMALL_SQUARE_PX: Final = 10
"""Least side of a chessboard's square, pixels: squares of 6 px are found, but their corners are inaccurate."""
SMALL_MODULE_PX: Final = 3
"""Least side of a marker's module, pixels: below 2 a marker is rarely read."""
FEWEST_MARKERS: Final = 4
"""Markers of another dictionary that are evidence for it: single ones are found in any texture."""
FIRST_MARKERS: Final = 100
"""Markers of each dictionary that are searched, from its first: boards number theirs from 0, and 1000 take 0.1 s."""
FEWEST_CORNERS: Final = 6
"""Corners that are evidence for another layout or dictionary."""
MOST_DIAGNOSED: Final = 30
"""Pictures that are searched for a reason: each takes up to a second."""
SMALLEST_GRID: Final = (3, 3)
"""Smallest part of a chessboard that is searched, inner corners."""


class MissingReason(Enum):
    """Kind of reason why the board was not found."""

    SWAPPED = "width and height swapped"
    DICTIONARY = "wrong dictionary"
    OTHER_KIND = "another kind of board"
    OTHER_COUNT = "other count"
    CUT_OFF = "cut off"
    IN_PART = "seen in part"
    TOO_SMALL = "too small"
    BLURRED = "blurred"
    NOT_SEEN = "board not seen"


class MissingBoard(msgspec.Struct, frozen=True):
    """The reason why the board was not found in one picture."""

    reason: MissingReason
    """Kind of reason."""
    detail: str = ""
    """Evidence in the picture, and what to do."""

    def __str__(self) -> str:
        """One line for the table of pictures."""
        return f"{self.reason.value}: {self.detail}" if self.detail else self.reason.value


class BoardDiagnosis:
    """Diagnoses pictures without the board. A correction of --board that fits one picture is tried first on others."""

    def __init__(self, board: CalibrationBoard) -> None:
        self._board = board
        self._finder = finder_of(board)
        self._corrections: list[tuple[BoardFinder, MissingBoard]] = []
        self._diagnosed = 0
        if board.across != board.down:
            swapped = board.swapped()
            detail = f"its corners fit {swapped.across}x{swapped.down}; write --board {swapped.text}"
            self._corrections.append((finder_of(swapped), MissingBoard(MissingReason.SWAPPED, detail)))

    def reason(self, picture: Grey) -> MissingBoard:
        """The reason of one picture in which the board was not found."""
        if min(picture.shape) < SMALLEST_PX:
            return MissingBoard(MissingReason.TOO_SMALL, f"the picture itself is smaller than {SMALLEST_PX} pixels")
        for finder, correction in self._corrections:
            if _finds(finder, picture):
                return correction
        if self._diagnosed == MOST_DIAGNOSED:
            return MissingBoard(MissingReason.NOT_SEEN)
        self._diagnosed += 1
        kind = self._chessboard_reasons if self._board.kind == "chessboard" else self._marker_reasons
        return next(kind(picture), MissingBoard(MissingReason.NOT_SEEN))

    def _chessboard_reasons(self, picture: Grey) -> Iterator[MissingBoard]:
        """The reasons of a chessboard, the likeliest first."""
        small = at_most(picture, LONGEST_SIDE_PX)
        grid = largest_grid(small)
        if grid is None or spacing_px(grid.reshape(-1, 2)) < SMALL_SQUARE_PX:
            yield from self._too_small(small, "squares", SMALL_SQUARE_PX)
        yield from _blurred(small)
        dictionary = _likeliest_dictionary(small, FIRST_MARKERS)
        if dictionary is not None:
            yield MissingBoard(MissingReason.OTHER_KIND, f"markers of {dictionary} are seen: charuco or aprilgrid?")
        if grid is not None:
            yield self._other_grid(grid, small)

    def _other_grid(self, grid: Floats, picture: Grey) -> MissingBoard:
        """The reason where a chessboard is seen, but not as --board counts it."""
        wanted, seen = (self._board.across, self._board.down), (grid.shape[1], grid.shape[0])
        if sorted(seen) == sorted(wanted):
            return MissingBoard(MissingReason.CUT_OFF, "its outer squares must be in the picture too")
        part = next((each for each in (seen, seen[::-1]) if each[0] <= wanted[0] and each[1] <= wanted[1]), None)
        if part is None:
            columns, rows = sorted(seen, reverse=wanted[0] >= wanted[1])
            counts = f"{columns}x{rows} inner corners are seen, --board has {wanted[0]}x{wanted[1]}"
            return MissingBoard(MissingReason.OTHER_COUNT, counts)
        counts = f"{part[0]}x{part[1]} of its {wanted[0]}x{wanted[1]} inner corners are in the picture"
        if _exceeds(grid, picture):
            return MissingBoard(MissingReason.CUT_OFF, counts)
        return MissingBoard(MissingReason.IN_PART, f"{counts}: the rest is covered, or --board counts squares")

    def _marker_reasons(self, picture: Grey) -> Iterator[MissingBoard]:
        """The reasons of a board with markers, the likeliest first."""
        own = self._board.dictionary if self._board.kind == "charuco" else "apriltag_36h11"
        number, small = opencv_dictionary(own), at_most(picture, LONGEST_SIDE_PX)
        if number is None:
            return
        markers, others = _quads(small, number)
        if len(markers) < FEWEST_MARKERS:
            yield from self._wrong_dictionary(picture, small)
        total = self._board.across * self._board.down // (2 if self._board.kind == "charuco" else 1)
        least_px = SMALL_MODULE_PX * _modules(number)
        sides = [_side_px(quad) for quad in markers + others]
        if len(sides) >= total / 3 and np.median(sides) < least_px:
            yield _smaller(float(np.median(sides)), "markers", least_px)
        yield from self._too_small(small, "markers", least_px)
        yield from _blurred(small)
        if any(_is_at_edge(quad, small) for quad in markers):
            yield MissingBoard(MissingReason.CUT_OFF, f"{len(markers)} of its {total} markers are in the picture")
        if markers:
            yield MissingBoard(MissingReason.NOT_SEEN, f"only {len(markers)} of its {total} markers are read")
        grid = largest_grid(small)
        if grid is not None:
            counts = f"a chessboard of {grid.shape[1]}x{grid.shape[0]} inner corners, without markers, is seen"
            yield MissingBoard(MissingReason.OTHER_KIND, counts)

    def _wrong_dictionary(self, picture: Grey, small: Grey) -> Iterator[MissingBoard]:
        """The reason where the markers are of another dictionary."""
        name = _likeliest_dictionary(small, max(FIRST_MARKERS, self._board.across * self._board.down))
        if name is None:
            return
        if self._board.kind == "aprilgrid":
            yield MissingBoard(
                MissingReason.DICTIONARY, f"its tags are of {name}; an aprilgrid has DICT_APRILTAG_36H11"
            )
            return
        for board in (self._board, self._board.swapped()):
            other = msgspec.structs.replace(board, text=board.text.rpartition(":")[0] + f":{name}", dictionary=name)
            try:
                finder = finder_of(other)
            except UserError:  # fewer markers than the board has
                continue
            if _finds(finder, picture):
                detail = f"its markers are of {name}; write --board {other.text}"
                self._corrections.insert(0, (finder, MissingBoard(MissingReason.DICTIONARY, detail)))
                yield self._corrections[0][1]
                return
        yield MissingBoard(MissingReason.DICTIONARY, f"its markers are of {name}, in another layout than --board has")

    def _too_small(self, picture: Grey, of: str, least_px: int) -> Iterator[MissingBoard]:
        """The reason where the board is found in the enlarged picture."""
        enlarged = cv2.resize(picture, None, fx=ENLARGEMENT, fy=ENLARGEMENT, interpolation=cv2.INTER_CUBIC)
        found = self._finder.find(np.asarray(enlarged, dtype=np.uint8))
        if found is None:
            return
        square_px = spacing_px(found[1]) / ENLARGEMENT
        side_px = square_px if of == "squares" else square_px * self._board.second_m / self._board.side_m
        if side_px < least_px:
            yield _smaller(side_px, of, least_px)


def edge_width_px(picture: Grey) -> float | None:
    """The width of the picture's sharper edges, in the direction of the stronger blur, pixels; None without edges.

    A width is the rise of the grey level within EDGE_REACH_PX over its steepest slope. The picture is taken at
    LONGEST_SIDE_PX at most, and smoothed by one pixel (sigma) against noise, so that a sharp edge is 3.1 wide.
    """
    smooth = cv2.GaussianBlur(at_most(picture, LONGEST_SIDE_PX).astype(np.float32), (0, 0), 1.0)
    slopes = [np.abs(cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3, scale=1.0 / 8.0)) for order in ((1, 0), (0, 1))]
    widths = []
    for slope, across, window in zip(slopes, slopes[::-1], ((1, -1), (-1, 1)), strict=True):
        kernel = np.ones([side if side == 1 else 2 * EDGE_REACH_PX + 1 for side in window], np.uint8)
        rise = cv2.dilate(smooth, kernel) - cv2.erode(smooth, kernel)
        at_edge = (slope >= cv2.dilate(slope, kernel)) & (rise > EDGE_CONTRAST) & (slope >= across)
        if at_edge.sum() >= FEWEST_EDGES:
            widths.append(float(np.percentile(rise[at_edge] / slope[at_edge], SHARPER_PERCENT)))
    return max(widths, default=None)


def largest_grid(picture: Grey) -> Floats | None:
    """The inner corners of the largest chessboard in the picture, (rows, columns, 2), pixels; None without one."""
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_LARGER
    found, corners, meta = cv2.findChessboardCornersSBWithMeta(picture, SMALLEST_GRID, flags)
    if not found:
        return None
    rows, columns = np.shape(meta)
    return np.asarray(corners, dtype=np.float64).reshape(rows, columns, 2)


def _exceeds(grid: Floats, picture: Grey) -> bool:
    """Whether the chessboard goes over the picture's edge: a square beyond its outermost corners would be outside."""
    beyond = [2.0 * grid[end] - grid[inner] for end, inner in ((0, 1), (-1, -2))]
    beyond += [2.0 * grid[:, end] - grid[:, inner] for end, inner in ((0, 1), (-1, -2))]
    outer = np.concatenate(beyond)
    height, width = picture.shape
    return bool(((outer < -0.5) | (outer > np.array([width, height]) - 0.5)).any())


def _blurred(picture: Grey) -> Iterator[MissingBoard]:
    width = edge_width_px(picture)
    if width is not None and width > BLURRED_PX:
        yield MissingBoard(MissingReason.BLURRED, f"its edges are {width:.0f} px wide, sharp ones are 3")


def _smaller(side_px: float, of: str, least_px: int) -> MissingBoard:
    return MissingBoard(MissingReason.TOO_SMALL, f"its {of} are about {ceil(side_px)} px wide; {least_px} are needed")


def _finds(finder: BoardFinder, picture: Grey) -> bool:
    found = finder.find(picture)
    return found is not None and len(found[0]) >= FEWEST_CORNERS


def _quads(picture: Grey, number: int) -> tuple[list[Floats], list[Floats]]:
    """The quadrangles, each (4, 2), that are markers of a dictionary, and those that are not."""
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(number))
    markers, _, others = detector.detectMarkers(picture)
    of_markers, of_others = (
        [np.asarray(quad, dtype=np.float64).reshape(4, 2) for quad in each] for each in (markers, others)
    )
    return of_markers, of_others


def _likeliest_dictionary(picture: Grey, count: int) -> str | None:
    """OpenCV's name of the dictionary with the most of its first ``count`` markers in the picture; None without any.

    In a series such as 4X4_50 to 4X4_1000, each dictionary begins with the markers of the one before: the largest is
    searched, and the smallest that has all the markers is named.
    """
    best, most, largest_id = "", FEWEST_MARKERS - 1, 0
    for series, names in _dictionary_series().items():
        whole = cv2.aruco.getPredefinedDictionary(MARKER_DICTIONARIES[names[-1]])
        first = cv2.aruco.Dictionary(whole.bytesList[:count], whole.markerSize, 0)  # 0: no bits are corrected
        _, ids, _ = cv2.aruco.ArucoDetector(first).detectMarkers(picture)
        if ids is not None and len(ids) > most:
            best, most, largest_id = series, len(ids), int(ids.max())
    if not best:
        return None
    name = next(name for name in _dictionary_series()[best] if _size(name) > largest_id)
    return f"DICT_{name.upper()}"


def _dictionary_series() -> dict[str, list[str]]:
    """The dictionaries by series, as 4x4, 5x5, apriltag_36h11, each from the smallest to the largest."""
    series: dict[str, list[str]] = {}
    for name in sorted(MARKER_DICTIONARIES, key=_size):
        head, _, count = name.rpartition("_")
        series.setdefault(head if count.isdigit() else name, []).append(name)
    return series


def _size(name: str) -> int:
    return len(cv2.aruco.getPredefinedDictionary(MARKER_DICTIONARIES[name]).bytesList)


def _modules(number: int) -> int:
    """Modules along a marker's side, the black border included."""
    return int(cv2.aruco.getPredefinedDictionary(number).markerSize) + 2


def _side_px(quad: Floats) -> float:
    return float(np.linalg.norm(np.roll(quad, -1, axis=0) - quad, axis=1).mean())


def _is_at_edge(quad: Floats, picture: Grey) -> bool:
    """Whether the next marker beyond this one would be outside the picture."""
    side, (height, width) = _side_px(quad), picture.shape
    return bool((quad < side).any() or (quad > np.array([width, height]) - side).any())
