"""Pictures to views of the board, and what to say of those in which it is not seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import msgspec
import numpy as np

from fwav_companion.errors import UserError
from fwav_companion.tools.calibrate.boards.finder import SMALLEST_PX, Finder, Found, Grey, spacing_px
from fwav_companion.tools.calibrate.boards.make import finder_of
from fwav_companion.tools.calibrate.boards.spec import Board, parse_board
from fwav_companion.tools.calibrate.lens_fit.corners import View
from fwav_companion.tools.calibrate.pictures import Shot, same_size

SAME: Final = 0.1
"""Of the distance between two corners: a board that moved by less was held still."""
HINTED: Final = 5
"""Pictures in which another count is tried, where the board is in none."""
OTHERS: Final = ((-1, -1), (1, 1), (0, -1), (-1, 0))
"""What people count: squares in place of the corners between them, or one row too many."""


class Looked(msgspec.Struct, frozen=True, eq=False):
    """All pictures have been looked at."""

    size: tuple[int, int]
    """Width, height of each, pixels."""
    views: tuple[View, ...]
    unused: dict[str, str]
    """The names of the other pictures, and why they show nothing, or nothing new."""
    hint: str = ""
    """Which board is in them instead; empty where none was found."""

    @property
    def pictures(self) -> int:
        """All that were looked at."""
        return len(self.views) + len(self.unused)


def look(taken: Sequence[Shot], board: Board, on_step: Callable[[], None]) -> Looked:
    """InputFileError where a picture cannot be read or is of another size; UserError where the board is no board."""
    finder = finder_of(board)
    views: list[View] = []
    unused: dict[str, str] = {}

    def show(shot: Shot, grey: Grey) -> None:
        found = _found(finder, grey)
        before = None if found is None else _shown_before(View(shot.name, *found), views)
        if found is None:
            unused[shot.name] = "board not seen"
        elif before is not None:
            unused[shot.name] = f"shows what {before} shows"
        else:
            views.append(View(shot.name, *found))
        on_step()

    size = same_size(taken, show)
    hint = "" if views else _hint(taken, board)
    return Looked(size, tuple(views), unused, hint)


def _shown_before(view: View, earlier: Sequence[View]) -> str | None:
    """The last component of the name of an earlier picture in which the same corners lie in nearly the same places.

    What is wrong with a view is wrong in its copies too: a hundred frames of a board held still are one picture, and
    counted as a hundred would make the claim ten times too good.
    """
    for other in earlier:
        mine, its = np.nonzero((view.board[:, None] == other.board[None]).all(axis=2))
        if len(mine) < min(len(view.board), len(other.board)):
            continue
        moved = np.linalg.norm(view.pixels[mine] - other.pixels[its], axis=1).mean()
        if moved < SAME * spacing_px(view.pixels):
            return Path(other.name).name
    return None


def _hint(taken: Sequence[Shot], board: Board) -> str:
    """The chessboard that is in the first pictures, where it is one of another count."""
    if board.kind != "chessboard":
        return ""
    pictures = [shot.look() for shot in taken[:HINTED]]
    for more_across, more_down in OTHERS:
        words = board.text.split(":")
        words[1] = f"{board.across + more_across}x{board.down + more_down}"
        try:
            other = parse_board(":".join(words))
        except UserError:
            continue
        if any(_found(finder_of(other), picture) is not None for picture in pictures):
            return f"a {words[1]} is there: inner corners are counted, not squares"
    return ""


def _found(finder: Finder, grey: Grey) -> Found | None:
    return finder.find(grey) if min(grey.shape) >= SMALLEST_PX else None
