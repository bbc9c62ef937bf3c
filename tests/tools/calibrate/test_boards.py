"""Board specifications, and finding the boards in pictures that the tests draw."""

import cv2
import numpy as np
import pytest
from drawn_boards import (
    PAPER,
    WIDE,
    aprilgrid_sheet,
    charuco_sheet,
    chess_grey,
    chess_points,
    picture,
    poses,
    printed_grey,
    turn,
)
from draws import first_rows_of

from fwav_companion.errors import UserError
from fwav_companion.tools.calibrate.board_finders import SMALLEST_PX, finder_of
from fwav_companion.tools.calibrate.board_spec import EXAMPLES, CalibrationBoard, parse_board

AHEAD = turn([0.2, 0.1, 1.0], 0.23)
"""Rotation off the pixel grid: lines along the rows of pixels would be drawn only as exactly as two samples a pixel
allow."""


def test_the_words_of_the_help():
    chess, charuco, grid = (parse_board(EXAMPLES[kind]) for kind in ("chessboard", "charuco", "aprilgrid"))
    assert chess == CalibrationBoard("chessboard:9x6:25mm", "chessboard", 9, 6, side_m=0.025)
    assert (charuco.across, charuco.down, charuco.side_m, charuco.second_m) == (7, 5, 0.03, 0.022)
    assert charuco.dictionary == "DICT_4X4_50"
    assert (grid.across, grid.down, grid.side_m, grid.second_m) == (6, 6, 0.088, 0.0264)


@pytest.mark.parametrize("length", ["25mm", "2.5cm", "0.025m", ".025m"])
def test_lengths_in_three_units(length):
    assert parse_board(f"chessboard:9x6:{length}").side_m == pytest.approx(0.025)


@pytest.mark.parametrize(
    "text",
    ["", "9x6", "circles:9x6:25mm", "chessboard", "chessboard:9x6", "chessboard:9x6:25", "chessboard:9x6:25mm:3mm",
     "chessboard:9:25mm", "chessboard:2x2:25mm", "chessboard:9x600:25mm", "chessboard:9x6:-1mm", "chessboard:9x6:0mm",
     "chessboard:9x6:25km", "chessboard:9x6:1e400mm", "charuco:7x5:30mm:30mm:DICT_4X4_50", "charuco:7x5:30mm:22mm",
     "aprilgrid:6x6:88mm", "aprilgrid:6x6:88mm:99m", "chessboard:9x6:2٢mm"],
)  # fmt: skip
def test_what_is_no_board_is_one_line(text):
    with pytest.raises(UserError, match="accepted: ") as caught:
        parse_board(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    ["charuco:7x5:30mm:22mm:DICT_9X9", "charuco:7x5:30mm:22mm:__doc__", "charuco:30x30:30mm:22mm:DICT_4X4_50",
     "aprilgrid:30x30:88mm:26mm"],
)  # fmt: skip
def test_what_opencv_has_not_is_one_line(text):
    with pytest.raises(UserError, match="accepted: "):
        finder_of(parse_board(text))


def miss_px(lens, pose, found, shift):
    """RMS of an axis, of corners against where the tests' lens sees them."""
    places, pixels = found
    rotation, middle = pose
    points = np.concatenate([places - shift, np.zeros((len(places), 1))], axis=1)
    return float(np.sqrt(((pixels - lens.pixels(points @ rotation.T + middle)) ** 2).mean()))


@pytest.mark.parametrize(
    ("lens", "reach", "share"),
    first_rows_of((WIDE, 1.0, 0.7), (PAPER, 0.25, 0.3)),
    ids=["200 degrees", "paper"],
)
def test_a_chessboard_is_found_to_a_tenth_of_a_pixel(lens, reach, share):
    rng, middle = np.random.default_rng(1), (chess_points(9, 6, 0.025)[-1] - chess_points(9, 6, 0.025)[0])[:2] / 2
    finder = finder_of(parse_board("chessboard:9x6:25mm"))
    for pose in poses(rng, 2, 0.25, reach=reach, share=share):
        found = finder.find(picture(lens, pose, chess_grey(9, 6, 0.025), rng))
        assert found is not None
        turned = (found[0], found[1][::-1])  # the same board, from the other end
        assert min(miss_px(lens, pose, each, middle) for each in (found, turned)) < 0.12


def test_a_large_picture_is_searched_small_and_measured_whole():
    large = cv2.resize(
        picture(PAPER, (AHEAD, np.array([0.0, 0.0, 0.5])), chess_grey(9, 6, 0.025), np.random.default_rng(1)),
        None,
        fx=4.0,
        fy=4.0,
    )
    small = finder_of(parse_board("chessboard:9x6:25mm")).find(cv2.resize(large, None, fx=0.25, fy=0.25))
    found = finder_of(parse_board("chessboard:9x6:25mm")).find(large)
    assert found is not None
    assert small is not None
    assert np.abs((found[1] + 0.5) / 4.0 - 0.5 - small[1]).max() < 0.25


@pytest.mark.parametrize(
    ("legacy", "down"), [(False, 5), (False, 6), (True, 6)], ids=["odd", "even", "even, old layout"]
)
def test_a_charuco_board_may_go_over_the_edge(legacy, down):
    sheet, rng = charuco_sheet(legacy, down), np.random.default_rng(1)
    grey = printed_grey(sheet, sheet.shape[1] / 60 * 0.03)
    finder = finder_of(parse_board(f"charuco:7x{down}:30mm:22mm:DICT_4X4_50"))
    for left, fewest, most in ((0.0, 20, 30), (-0.19, 6, 20)):
        pose = (AHEAD, np.array([left, 0.0, 0.4]))
        found = finder.find(picture(PAPER, pose, grey, rng))
        assert found is not None
        assert fewest <= len(found[0]) <= most
        assert miss_px(PAPER, pose, found, np.array([0.105, 0.015 * down])) < 0.15


@pytest.mark.parametrize(("up", "turned"), [(True, 0), (True, 2), (False, 1)])
def test_kalibrs_grid_is_found_whichever_way_it_is_numbered(up, turned):
    sheet = aprilgrid_sheet(4, 3, 80, 24, up=up, turned=turned)
    pose, per_m = (AHEAD, np.array([0.0, 0.0, 0.6])), 80 / 0.08
    found = finder_of(parse_board("aprilgrid:4x3:80mm:24mm")).find(
        picture(PAPER, pose, printed_grey(sheet, sheet.shape[1] / per_m), np.random.default_rng(1))
    )
    assert found is not None
    places, _ = found
    assert len(places) >= 32
    middle = np.array([sheet.shape[1] / per_m / 2 - 0.048, sheet.shape[0] / per_m / 2 - 0.048])
    shift = middle - ([0.0, 0.208] if places[:, 1].min() < -0.01 else [0.0, 0.0])
    assert miss_px(PAPER, pose, found, shift) < 0.2


@pytest.mark.parametrize("text", EXAMPLES.values())
def test_nothing_is_found_where_nothing_is(text):
    rng = np.random.default_rng(1)
    finder = finder_of(parse_board(text))
    least = (SMALLEST_PX, SMALLEST_PX)
    for grey in (np.zeros(least, np.uint8), rng.integers(0, 255, least, np.uint8), np.full((240, 320), 7, np.uint8)):
        assert finder.find(grey) is None
