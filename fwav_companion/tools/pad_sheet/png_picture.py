"""A pad's sheet as one PNG picture that states its resolution, so that it prints at true size."""

from __future__ import annotations

import struct
import zlib
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fwav_companion.tools.pad_sheet.sheet import CAPTION_MM, Sheet

DOTS_PER_MM: Final = 12.0
"""Finest resolution: 305 dots an inch."""
MOST_DOTS: Final = 8000
"""Most dots along a side; a larger sheet is coarser."""
BORDER_MM: Final = 5.0
RULER_MM: Final = 100
"""Length of the ruler; shorter on a narrower sheet, in whole centimetres."""
FOOT_MM: Final = 22.0
FRACTION_BITS: Final = 6
"""Bits after the point of OpenCV's coordinates."""


def png_of(sheet: Sheet) -> bytes:
    """The file of a sheet, grey levels."""
    picture, dots_per_mm = picture_of(sheet)
    dots_per_m = round(1000.0 * dots_per_mm)
    height, width = picture.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), picture], axis=1).tobytes()  # filter 0 before each row
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)),
        (b"pHYs", struct.pack(">IIB", dots_per_m, dots_per_m, 1)),
        (b"IDAT", zlib.compress(rows, 6)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )


def picture_of(sheet: Sheet) -> tuple[NDArray[np.uint8], float]:
    """The picture with the ruler below the sheet, and its dots a millimetre, a whole number a metre."""
    width, height = sheet.width + 2.0 * BORDER_MM, sheet.height + 2.0 * BORDER_MM + FOOT_MM
    dots_per_mm = np.floor(1000.0 * min(DOTS_PER_MM, MOST_DOTS / max(width, height))) / 1000.0
    picture = np.full((round(height * dots_per_mm), round(width * dots_per_mm)), 255, np.uint8)
    scale = (1 << FRACTION_BITS) * dots_per_mm

    def dots(x: float, y: float) -> tuple[int, int]:
        """A place on the sheet in OpenCV's coordinates, which count from the centre of the first dot."""
        half = (1 << FRACTION_BITS) / 2.0
        return round((x - sheet.left + BORDER_MM) * scale - half), round((y - sheet.top + BORDER_MM) * scale - half)

    def line(start: tuple[float, float], end: tuple[float, float]) -> None:
        cv2.line(picture, dots(*start), dots(*end), 0, max(1, round(0.2 * dots_per_mm)), cv2.LINE_AA, FRACTION_BITS)

    def text(at: tuple[float, float], words: str) -> None:
        u, v = (value >> FRACTION_BITS for value in dots(*at))
        size = CAPTION_MM * dots_per_mm / 22.0  # Hershey's capitals are 22 units high
        cv2.putText(picture, words, (u, v), cv2.FONT_HERSHEY_SIMPLEX, size, 0, max(1, round(size)), cv2.LINE_AA)

    for polygon in sheet.polygons:
        corners = np.array([dots(*corner) for corner in polygon.corners]) / float(1 << FRACTION_BITS)
        _fill(picture, corners, 0 if polygon.black else 255)
    for caption in sheet.captions:
        text(caption.at, caption.text)
    length = max(10, min(RULER_MM, int(sheet.width // 10) * 10))
    y = sheet.bottom + BORDER_MM
    line((sheet.left, y), (sheet.left + length, y))
    for mm in range(length + 1):
        line((sheet.left + mm, y), (sheet.left + mm, y + (5.0 if mm % 10 == 0 else 2.0)))
    text((sheet.left, y + 12.0), f"{length} mm: print at 100 %")
    return picture, float(dots_per_mm)


def _fill(picture: NDArray[np.uint8], corners: NDArray[np.float64], level: int) -> None:
    """Fill the dots whose centres lie in a convex polygon, (N, 2) x and y. OpenCV's filled polygons grow by a dot."""
    height, width = picture.shape
    left, top = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
    right, bottom = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 1, (width, height))
    x, y = np.arange(left, right)[None, :], np.arange(top, bottom)[:, None]
    inside = np.ones((len(y), x.shape[1]), np.bool_)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0
    picture[top:bottom, left:right][inside] = level
