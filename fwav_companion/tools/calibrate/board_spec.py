"""The argument of ``--board``, parsed.

    chessboard:9x6:25mm                       inner corners across x down, side of a square
    charuco:7x5:30mm:22mm:DICT_4X4_50         squares across x down, side of a square, side of a marker, dictionary
    aprilgrid:6x6:88mm:26.4mm                 tags across x down, side of a tag, gap between tags (Kalibr's)

A grid of circles is not supported: through a fisheye, the centre of a circle's image is not the image of its centre.
"""

from __future__ import annotations

import re
from typing import Final

import msgspec

from fwav_companion.errors import UserError

EXAMPLES: Final = {
    "chessboard": "chessboard:9x6:25mm",
    "charuco": "charuco:7x5:30mm:22mm:DICT_4X4_50",
    "aprilgrid": "aprilgrid:6x6:88mm:26.4mm",
}
METRES: Final = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
FEWEST, MOST = 2, 60
"""Limits of a count along a side. A chessboard has at least three: OpenCV searches for no fewer."""
LARGEST_M: Final = 10.0


class CalibrationBoard(msgspec.Struct, frozen=True):
    """A printed calibration board."""

    text: str
    """Argument of --board."""
    kind: str
    """Key of EXAMPLES."""
    across: int
    """Columns: inner corners of a chessboard, squares of a ChArUco board, tags of an AprilGrid."""
    down: int
    """Rows, counted likewise."""
    side_m: float
    """Side of a square or of a tag, metres."""
    second_m: float = 0.0
    """Side of a ChArUco board's marker, or gap between tags, metres."""
    dictionary: str = ""
    """Marker dictionary of a ChArUco board as the user wrote it, with or without OpenCV's DICT_."""

    def swapped(self) -> CalibrationBoard:
        """The board with columns and rows exchanged."""
        across, down = self.down, self.across
        text = self.text.replace(f":{self.across}x{self.down}:", f":{across}x{down}:", 1)
        return CalibrationBoard(
            text, self.kind, across, down, side_m=self.side_m, second_m=self.second_m, dictionary=self.dictionary
        )


def parse_board(text: str) -> CalibrationBoard:
    """The board that ``text`` describes. UserError names the text and what is accepted."""
    kind, *words = text.split(":")
    if kind not in EXAMPLES:
        raise _refused(text, ", ".join(EXAMPLES.values()))
    if len(words) != EXAMPLES[kind].count(":"):
        raise _refused(text, EXAMPLES[kind])
    across, down = _counts(text, kind, words[0])
    side, *rest = (_metres(text, kind, word) for word in words[1:3])
    second = rest[0] if rest else 0.0
    if kind == "charuco" and not second < side:
        raise _refused(text, f"markers that are smaller than their squares, as {EXAMPLES[kind]}")
    dictionary = words[3] if kind == "charuco" else ""
    return CalibrationBoard(text, kind, across, down, side_m=side, second_m=second, dictionary=dictionary)


def _counts(text: str, kind: str, word: str) -> tuple[int, int]:
    match = re.fullmatch(r"([0-9]{1,4})x([0-9]{1,4})", word)
    least = FEWEST + (kind != "aprilgrid")
    if match is None or not all(least <= int(count) <= MOST for count in match.groups()):
        raise _refused(text, f"two counts of {least} to {MOST}, as {EXAMPLES[kind]}")
    return int(match[1]), int(match[2])


def _metres(text: str, kind: str, word: str) -> float:
    match = re.fullmatch(r"([0-9]+\.?[0-9]*|\.[0-9]+)(mm|cm|m)", word)
    if match is None:
        raise _refused(text, f"a length in mm, cm or m, as {EXAMPLES[kind]}")
    metres = float(match[1]) * METRES[match[2]]
    if not 0.0 < metres <= LARGEST_M:
        raise _refused(text, f"a length above zero and up to {LARGEST_M:g} m, as {EXAMPLES[kind]}")
    return metres


def _refused(text: str, accepted: str) -> UserError:
    return UserError(f"--board {text!r}: accepted: {accepted}")
