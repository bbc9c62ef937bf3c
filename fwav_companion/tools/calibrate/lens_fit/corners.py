"""What is fitted: the corners of a flat board in several pictures, and where board and lens stand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]


class View(msgspec.Struct, frozen=True, eq=False):
    """One picture in which the board was seen."""

    name: str
    """The picture's, for people."""
    board: Floats
    """(N, 2) places of the corners on the board, metres."""
    pixels: Floats
    """(N, 2) where the picture shows them."""


class Corners(msgspec.Struct, frozen=True, eq=False):
    """All views' corners one after another."""

    board: Floats
    """(M, 3) on the board, metres; the third is zero."""
    pixels: Floats
    """(M, 2)."""
    view: NDArray[np.intp]
    """(M,) the number of the view."""
    starts: NDArray[np.intp]
    """(V,) the first corner of each view."""

    def by_view(self, values: Floats) -> Floats:
        """(V, ...) sums over each view of (M, ...) values."""
        sums: Floats = np.add.reduceat(values, self.starts, axis=0)
        return sums


class State(msgspec.Struct, frozen=True, eq=False):
    """A lens and where each view's board stands."""

    lens: Floats
    """u0, v0, the stretch of v, c1 .. cn: see :mod:`fwav_companion.tools.calibrate.lens_fit.projection`."""
    turns: Floats
    """(V, 3, 3) camera_from_board."""
    places: Floats
    """(V, 3) of the boards' origins in the camera frame, metres."""


def gather(views: Sequence[View]) -> Corners:
    """At least one view, each of at least one corner."""
    counts = [len(view.pixels) for view in views]
    board = np.concatenate([view.board for view in views])
    return Corners(
        np.concatenate([board, np.zeros((len(board), 1))], axis=1),
        np.concatenate([view.pixels for view in views]),
        np.repeat(np.arange(len(views)), counts),
        np.cumsum([0, *counts[:-1]]),
    )
