"""A pad's tags as black and white polygons in millimetres: x to the right of the pad, y backward, as a page is read."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, radians, sin
from typing import Final, TypeAlias

import cv2

from fwav_companion.errors import UserError
from fwav_companion.types import Pad, PadTag

Point: TypeAlias = tuple[float, float]

MM_PER_M: Final = 1000.0
ARUCO: Final = "aruco"
FAMILIES: Final = {
    "tag16h5": (cv2.aruco.DICT_APRILTAG_16h5, 6),
    "tag25h9": (cv2.aruco.DICT_APRILTAG_25h9, 7),
    "tag36h10": (cv2.aruco.DICT_APRILTAG_36h10, 8),
    "tag36h11": (cv2.aruco.DICT_APRILTAG_36h11, 8),
}
"""OpenCV's dictionary of each family, and the number of modules along a side of the black square."""
MARGIN_MODULES: Final = 1
"""Width of the white border that every tag needs, modules."""
CROSS_MM: Final = 8.0
"""Half length of the cross at the landing point."""
CAPTION_MM: Final = 3.5
"""Height of a caption's letters."""


@dataclass(frozen=True)
class Polygon:
    """A filled polygon."""

    corners: tuple[Point, ...]
    black: bool


@dataclass(frozen=True)
class Caption:
    """A line of text; ``at`` is the lower left of its first letter."""

    at: Point
    text: str


@dataclass(frozen=True)
class Sheet:
    """Everything on a pad's sheet, millimetres; later polygons cover earlier ones."""

    name: str
    left: float
    top: float
    right: float
    bottom: float
    polygons: tuple[Polygon, ...]
    captions: tuple[Caption, ...]

    @property
    def width(self) -> float:
        """Extent to the right, millimetres."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Extent downward, millimetres."""
        return self.bottom - self.top


def pad_sheet(pad: Pad, dictionary: str) -> Sheet:
    """The sheet of a pad. ``dictionary``: [vision] aruco_dictionary, of ``aruco`` labels. UserError for another label.

    Large tags come first, so that a tag in another's blank is drawn on it.
    """
    polygons: list[Polygon] = []
    captions: list[Caption] = []
    edges: list[Point] = []
    for tag in sorted(pad.tags, key=lambda tag: -tag.size_m):
        modules = _modules(tag.label, dictionary)
        count = len(modules)
        half = 0.5 * MM_PER_M * tag.size_m
        module = 2.0 * half / count
        border = half + MARGIN_MODULES * module
        outline = _square(tag, -border, -border, border, border)
        edges.extend(outline)
        polygons.append(Polygon(outline, black=False))
        for row, cells in enumerate(modules):
            for first, last in _runs(cells):
                left, right = -half + first * module, -half + last * module
                top = -half + row * module
                polygons.append(Polygon(_square(tag, left, top, right, top + module), black=True))
        captions.append(Caption(_below(outline), f"{tag.label}  {2.0 * half:.1f} mm"))
    left, right = min(x for x, _ in edges), max(x for x, _ in edges)
    top, bottom = min(y for _, y in edges), max(y for _, y in edges) + 2.5 * CAPTION_MM
    polygons.extend(_cross(pad, (left, top, right, bottom)))
    boards = [polygon for polygon in polygons if not polygon.black]
    clear = [caption for caption in captions if not any(_covers(board, caption) for board in boards)]
    return Sheet(pad.label, left, top, right, bottom, tuple(polygons), tuple(clear))


def _modules(label: str, dictionary: str) -> list[list[bool]]:
    """Whether each module of a tag is black, row by row from the upper left."""
    family, _, number = label.rpartition(":")
    if family == ARUCO:
        side, _ = dictionary.split("_")
        chosen, count = getattr(cv2.aruco, f"DICT_{side.upper()}_{dictionary.split('_')[1]}"), int(side[0]) + 2
    elif family in FAMILIES:
        chosen, count = FAMILIES[family]
    else:
        known = ", ".join(f"{name}:ID" for name in (*FAMILIES, ARUCO))
        raise UserError(f'check --pad: a tag labelled "{label}" cannot be drawn; accepted: {known}')
    marker = cv2.aruco.getPredefinedDictionary(chosen)
    most = len(marker.bytesList) - 1
    if not number.isdecimal() or int(number) > most:
        raise UserError(f'check --pad: "{label}": accepted: {family}:0 to {family}:{most}')
    picture = cv2.aruco.generateImageMarker(marker, int(number), count)
    return [[value < 128 for value in row] for row in picture.tolist()]


def _runs(cells: list[bool]) -> list[tuple[int, int]]:
    """First column and the one after the last of each run of black modules."""
    runs, start = [], None
    for column, black in enumerate([*cells, False]):
        if black and start is None:
            start = column
        elif not black and start is not None:
            runs.append((start, column))
            start = None
    return runs


def _square(tag: PadTag, left: float, top: float, right: float, bottom: float) -> tuple[Point, ...]:
    """Corners of a rectangle of a tag's print, on the page."""
    turn = radians(tag.yaw_deg)
    forward, aside = MM_PER_M * tag.at_m[0], MM_PER_M * tag.at_m[1]
    return tuple(
        (aside + x * cos(turn) - y * sin(turn), -forward + x * sin(turn) + y * cos(turn))
        for x, y in ((left, top), (right, top), (right, bottom), (left, bottom))
    )


def _below(outline: tuple[Point, ...]) -> Point:
    """The place of a caption below a tag's board."""
    return min(x for x, _ in outline), max(y for _, y in outline) + 1.5 * CAPTION_MM


def _covers(board: Polygon, caption: Caption) -> bool:
    """Whether a board may lie under a caption, by their upright boxes: its text would spoil the tag's white border."""
    x, y = caption.at
    us, vs = [u for u, _ in board.corners], [v for _, v in board.corners]
    beside = max(us) < x or min(us) > x + 0.65 * CAPTION_MM * len(caption.text)
    return not (beside or max(vs) < y - CAPTION_MM or min(vs) > y + 0.3 * CAPTION_MM)


def _cross(pad: Pad, page: tuple[float, float, float, float]) -> list[Polygon]:
    """A thin cross at the landing point, where no tag is and where the page has it."""
    x, y = MM_PER_M * pad.landing_offset_m[1], -MM_PER_M * pad.landing_offset_m[0]
    left, top, right, bottom = page
    clear = all(
        hypot(x - MM_PER_M * tag.at_m[1], y + MM_PER_M * tag.at_m[0]) > 0.9 * MM_PER_M * tag.size_m + CROSS_MM
        for tag in pad.tags
    )
    if not (clear and left < x < right and top < y < bottom):
        return []
    thin = 0.25
    return [
        Polygon(((x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b)), black=True)
        for a, b in ((CROSS_MM, thin), (thin, CROSS_MM))
    ]
