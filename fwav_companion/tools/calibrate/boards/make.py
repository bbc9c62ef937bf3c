"""From a board to its finder."""

from __future__ import annotations

from fwav_companion.tools.calibrate.boards.aprilgrid import AprilgridFinder
from fwav_companion.tools.calibrate.boards.charuco import CharucoFinder
from fwav_companion.tools.calibrate.boards.chessboard import ChessboardFinder
from fwav_companion.tools.calibrate.boards.finder import Finder
from fwav_companion.tools.calibrate.boards.spec import Board


def finder_of(board: Board) -> Finder:
    """UserError where OpenCV knows no such board."""
    if board.kind == "charuco":
        return CharucoFinder(board)
    if board.kind == "aprilgrid":
        return AprilgridFinder(board)
    return ChessboardFinder(board)
