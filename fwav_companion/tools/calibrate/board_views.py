"""Pictures to views of the board, and the reason for each picture without one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.board_finders import (
    SMALLEST_PX,
    BoardFinder,
    FoundCorners,
    Grey,
    finder_of,
    spacing_px,
)
from fwav_companion.tools.calibrate.board_spec import CalibrationBoard
from fwav_companion.tools.calibrate.image_coverage import ImageCoverage
from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardView
from fwav_companion.tools.calibrate.missing_board import (
    BLURRED_PX,
    BoardDiagnosis,
    MissingBoard,
    MissingReason,
    edge_width_px,
)
from fwav_companion.tools.calibrate.pictures import CalibrationPicture, same_size
from fwav_companion.tools.calibrate.view_spread import spread_out

SAME: Final = 0.1
"""Largest mean motion between two views of a board that was held still, in distances between two corners."""


class BoardSearch(msgspec.Struct, frozen=True, eq=False):
    """The result of the search for the board in all pictures."""

    size: tuple[int, int]
    """Width and height of every picture, pixels."""
    views: tuple[BoardView, ...]
    """The board's corners, of each picture with a new view of it."""
    missing: dict[str, MissingBoard]
    """Reason, by the name of each picture in which the board was not found."""
    repeated: dict[str, str]
    """Name of the earlier picture, by the name of each picture that shows the same view."""
    blurred: dict[str, float]
    """Width of the edges in pixels, by the name of each blurred picture with the board."""
    crowded: tuple[str, ...] = ()
    """Names of the frames of a video whose views lie near to others."""

    @property
    def pictures(self) -> int:
        """The number of pictures."""
        return len(self.views) + len(self.missing) + len(self.repeated) + len(self.crowded)

    @property
    def unused(self) -> dict[str, str]:
        """The reason, by the name of each picture that gives no view."""
        repeated = {name: f"shows what {earlier} shows" for name, earlier in self.repeated.items()}
        missing = {name: str(why) for name, why in self.missing.items()}
        return missing | repeated | dict.fromkeys(self.crowded, "near to the view of another frame")

    @property
    def reasons(self) -> str:
        """The reasons why the board was not found, the most frequent first, with one example of its detail."""
        reasons = [why for why in self.missing.values() if why.reason is not MissingReason.NOT_SEEN]
        counts = Counter(why.reason for why in reasons)
        examples = {why.reason: str(why) for why in reversed(reasons)}
        return "; ".join(f"{examples[reason]} ({count} of {self.pictures})" for reason, count in counts.most_common())


def find_board(
    pictures: Sequence[CalibrationPicture], board: CalibrationBoard, on_step: Callable[[str], None]
) -> BoardSearch:
    """The views of the board. InputFileError: a picture is unreadable or of another size. UserError: no such board.

    ``on_step`` takes, after each picture, which parts of the image the boards have covered by then.
    """
    finder, diagnosis, coverage = finder_of(board), BoardDiagnosis(board), ImageCoverage()
    views: list[BoardView] = []
    missing: dict[str, MissingBoard] = {}
    repeated: dict[str, str] = {}
    blurred: dict[str, float] = {}

    def search(picture: CalibrationPicture, grey: Grey) -> None:
        found = _found(finder, grey)
        if found is None:
            missing[picture.name] = diagnosis.reason(grey)
        else:
            view = BoardView(picture.name, *found)
            earlier = _earlier_copy(view, views)
            width_px = edge_width_px(grey)
            if earlier is not None:
                repeated[picture.name] = earlier
            else:
                views.append(view)
                coverage.add(view.pixels, grey.shape[1], grey.shape[0])
                blurred.update({picture.name: width_px} if width_px is not None and width_px > BLURRED_PX else {})
        on_step(coverage.shown())

    size = same_size(pictures, search)
    chosen = sorted(spread_out(views, size)) if any(picture.of_video for picture in pictures) else range(len(views))
    return BoardSearch(
        size=size,
        views=tuple(views[i] for i in chosen),
        missing=missing,
        repeated=repeated,
        blurred=blurred,
        crowded=tuple(view.name for i, view in enumerate(views) if i not in set(chosen)),
    )


def _earlier_copy(view: BoardView, earlier: Sequence[BoardView]) -> str | None:
    """The file name of an earlier picture in which the same corners have nearly the same pixels; None for a new view.

    An error in a view is in its copies too. A hundred frames of a board held still are one picture: counted as a
    hundred, they would make the claimed accuracy ten times too good.
    """
    for other in earlier:
        mine, its = np.nonzero((view.board[:, None] == other.board[None]).all(axis=2))
        if len(mine) < min(len(view.board), len(other.board)):
            continue
        moved = np.linalg.norm(view.pixels[mine] - other.pixels[its], axis=1).mean()
        if moved < SAME * spacing_px(view.pixels):
            return Path(other.name).name
    return None


def _found(finder: BoardFinder, grey: Grey) -> FoundCorners | None:
    return finder.find(grey) if min(grey.shape) >= SMALLEST_PX else None
