"""Pictures with a known fault: the reason why the board is not found names it, in the table of the real command."""

import cv2
import numpy as np
import pytest
from drawn_boards import PAPER, aprilgrid_sheet, charuco_sheet, chess_grey, picture, printed_grey, turn

from fwav_companion.cli.main import main
from fwav_companion.tools.calibrate.board_finders import finder_of
from fwav_companion.tools.calibrate.board_spec import parse_board
from fwav_companion.tools.calibrate.missing_board import MOST_DIAGNOSED, BoardDiagnosis, MissingReason, edge_width_px

AHEAD = turn([0.2, 0.1, 1.0], 0.23)
CHESS, CHARUCO, GRID = "chessboard:9x6:25mm", "charuco:7x5:30mm:22mm:DICT_4X4_50", "aprilgrid:4x3:80mm:24mm"


def chess(middle, columns=9, rows=6):
    return picture(PAPER, (AHEAD, np.array(middle)), chess_grey(columns, rows, 0.025), np.random.default_rng(1))


def printed(sheet, width_m, middle):
    return picture(PAPER, (AHEAD, np.array(middle)), printed_grey(sheet, width_m), np.random.default_rng(1))


def charuco(middle=(0.0, 0.0, 0.4), **sheet):
    drawn = charuco_sheet(**sheet)
    return printed(drawn, drawn.shape[1] / 60 * 0.03, middle)


def aprilgrid(middle=(0.0, 0.0, 0.6), across=4, down=3, **sheet):
    drawn = aprilgrid_sheet(across, down, 80, 24, up=True, turned=0, **sheet)
    return printed(drawn, drawn.shape[1] / 1000, middle)


def moved(seen, pixels):
    """Blurred by a motion along the rows."""
    return cv2.filter2D(seen, -1, np.full((1, pixels), 1.0 / pixels))


FAULTS = {
    "chessboard, cut off": (CHESS, lambda: chess([-0.15, 0.0, 0.45]), "cut off: 7x6 of its 9x6 inner corners"),
    "chessboard, far": (CHESS, lambda: chess([0.0, 0.0, 5.0]), "too small: its squares are about 3 px wide; 10 are"),
    "chessboard, squares": ("chessboard:10x7:25mm", lambda: chess([0, 0, 0.5]), "seen in part: 9x6 of its 10x7"),
    "chessboard, motion": (CHESS, lambda: moved(chess([0.0, 0.0, 0.5]), 61), "blurred: its edges are"),
    "chessboard is a charuco": (CHESS, charuco, "another kind of board: markers of DICT_4X4_50 are seen"),
    "charuco, defocused": (CHARUCO, lambda: cv2.GaussianBlur(charuco(), (0, 0), 4.0), "blurred: its edges are 8 px"),
    "charuco, motion": (CHARUCO, lambda: moved(charuco(), 17), "blurred: its edges are 7 px"),
    "charuco, far": (CHARUCO, lambda: charuco([0.0, 0.0, 2.2]), "too small: its markers are about"),
    "charuco, cut off": (CHARUCO, lambda: charuco([-0.27, 0.0, 0.4]), "cut off: 2 of its 17 markers are"),
    "charuco, swapped": (
        "charuco:5x7:30mm:22mm:DICT_4X4_50",
        charuco,
        "width and height swapped: its corners fit 7x5; write --board charuco:7x5:30mm:22mm:DICT_4X4_50",
    ),
    "charuco, dictionary": (
        CHARUCO,
        lambda: charuco(dictionary=cv2.aruco.DICT_5X5_100),
        "wrong dictionary: its markers are of DICT_5X5_50; write --board charuco:7x5:30mm:22mm:DICT_5X5_50",
    ),
    "charuco, dictionary and swapped": (
        "charuco:5x7:30mm:22mm:DICT_4X4_50",
        lambda: charuco(dictionary=cv2.aruco.DICT_APRILTAG_36h11),
        "wrong dictionary: its markers are of DICT_APRILTAG_36H11; write --board charuco:7x5:30mm:22mm:DICT_A",
    ),
    "charuco is a chessboard": (CHARUCO, lambda: chess([0, 0, 0.5]), "another kind of board: a chessboard of "),
    "aprilgrid, swapped": ("aprilgrid:3x4:80mm:24mm", aprilgrid, "width and height swapped: its corners fit 4x3"),
    "aprilgrid, family": (
        GRID,
        lambda: aprilgrid(family=cv2.aruco.DICT_APRILTAG_25h9),
        "wrong dictionary: its tags are of DICT_APRILTAG_25H9; an aprilgrid has DICT_APRILTAG_36H11",
    ),
    "aprilgrid, defocused": (GRID, lambda: cv2.GaussianBlur(aprilgrid(), (0, 0), 8.0), "blurred: "),
    "nothing": (CHESS, lambda: chess([0.0, 0.0, -1.0]), "board not seen"),
}  # fmt: skip


FEWER = (
    *("charuco, motion", "charuco, dictionary and swapped", "charuco, far", "aprilgrid, defocused"),
    *("chessboard, motion", "chessboard, squares"),
)
"""Each of these differs from another fault in the kind of board or of blur, joins two, or is tested below by its grid
alone."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in FEWER else name for name in FAULTS]
)
def test_the_reason_is_named(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    board, draw, expected = FAULTS[name]
    seen = draw()
    assert finder_of(parse_board(board)).find(seen) is None
    cv2.imwrite("1.png", seen)

    status = main(["calibrate", "1.png", "--board", board, "--out", "camera.yaml"])

    shown = capsys.readouterr()
    assert status == 2
    assert expected in " ".join(shown.out.split())
    assert (expected in shown.err) == (name != "nothing")
    assert shown.err.count("\n") == 1


@pytest.mark.parametrize(
    ("columns", "rows", "left", "expected"),
    [
        (9, 6, 100, "cut off: its outer squares must be in the picture too"),
        (6, 9, 100, "cut off: its outer squares must be in the picture too"),
        (6, 5, 100, "seen in part: 6x5 of its 9x6 inner corners are in the picture: the rest is covered, or --board"),
        (6, 5, 20, "cut off: 6x5 of its 9x6 inner corners are in the picture"),
        (5, 6, 20, "cut off: 5x6 of its 9x6 inner corners are in the picture"),
        (4, 7, 20, "cut off: 7x4 of its 9x6 inner corners are in the picture"),
        (8, 10, 20, "other count: 10x8 inner corners are seen, --board has 9x6"),
    ],
)
def test_what_part_of_a_chessboard_is_seen(columns, rows, left, expected, monkeypatch):
    """Squares of 40 px, the leftmost corners at ``left``."""
    grid = np.stack(np.meshgrid(left + 40.0 * np.arange(columns), 60.0 + 40.0 * np.arange(rows)), axis=-1)
    monkeypatch.setattr("fwav_companion.tools.calibrate.missing_board.largest_grid", lambda _picture: grid)
    reason = BoardDiagnosis(parse_board(CHESS)).reason(np.zeros((480, 640), np.uint8))
    assert str(reason).startswith(expected)


def test_the_correction_of_one_picture_is_kept_for_the_others():
    """If there are more pictures than are searched thoroughly, all of them name the dictionary."""
    diagnosis = BoardDiagnosis(parse_board(CHARUCO))
    seen = charuco(dictionary=cv2.aruco.DICT_6X6_250)
    reasons = {diagnosis.reason(seen).reason for _ in range(MOST_DIAGNOSED + 3)}
    assert reasons == {MissingReason.DICTIONARY}


def test_an_empty_picture_is_searched_thoroughly_only_some_times(monkeypatch):
    searched = []
    diagnosis = BoardDiagnosis(parse_board(CHESS))
    monkeypatch.setattr(diagnosis, "_chessboard_reasons", lambda picture: iter(searched.append(picture) or ()))
    for _ in range(MOST_DIAGNOSED + 3):
        assert diagnosis.reason(np.zeros((48, 64), np.uint8)).reason is MissingReason.NOT_SEEN
    assert len(searched) == MOST_DIAGNOSED


@pytest.mark.parametrize("times", [1, 4])
def test_the_width_of_edges(times):
    """Sharp ones are 3 wide, also in a large picture; the sigma of a blur adds to that as squares do."""
    seen = chess([0.0, 0.0, 0.5])
    large = cv2.resize(seen, None, fx=times, fy=times, interpolation=cv2.INTER_CUBIC)
    assert edge_width_px(large) == pytest.approx(3.3, abs=0.4)
    for sigma in (2.0, 3.0):
        expected = np.sqrt(2.0 * np.pi) * np.hypot(3.1 / np.sqrt(2.0 * np.pi), sigma)
        assert edge_width_px(cv2.GaussianBlur(seen, (0, 0), sigma)) == pytest.approx(expected, abs=0.4)
    assert edge_width_px(np.full((48, 64), 90, np.uint8)) is None
