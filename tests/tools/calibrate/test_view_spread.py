"""Of a video's views those are used that lie apart: a hand that rests does not weigh more."""

import cv2
import numpy as np
import pytest
from drawn_boards import PAPER, chess_points, turn, views

from fwav_companion.cli.progress import steps
from fwav_companion.tools.calibrate.board_spec import parse_board
from fwav_companion.tools.calibrate.board_views import find_board
from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardView
from fwav_companion.tools.calibrate.pictures import pictures_of
from fwav_companion.tools.calibrate.view_spread import FEWEST_VIEWS, MOST_VIEWS, sight_of, spread_out


def seen(rotation, middle, name, rng):
    """A board of 7 x 5 corners in that pose, through the paper's lens."""
    points = chess_points(7, 5, 0.03)
    pixels = PAPER.pixels(points @ rotation.T + middle) + rng.normal(0.0, 0.1, (len(points), 2))
    return BoardView(name, points[:, :2], pixels)


def test_a_hand_that_rests_does_not_crowd_out_the_other_poses():
    """300 frames of a board that trembles by millimetres, between 24 poses all over the image."""
    rng = np.random.default_rng(1)
    apart = [BoardView(*view) for view in views(PAPER, rng, 24, reach=0.3, share=0.2)]
    resting = [
        seen(np.eye(3), np.array([0.0, 0.0, 0.8]) + rng.normal(0.0, 0.002, 3), f"rest{i}", rng) for i in range(300)
    ]
    chosen = spread_out([*resting[:150], *apart, *resting[150:]], PAPER.size)
    of_apart = {i for i in chosen if 150 <= i < 150 + len(apart)}
    assert len(of_apart) >= 0.8 * len(apart)
    assert len(chosen) - len(of_apart) <= 3


def test_tilts_to_all_sides_are_kept_apart_in_one_place():
    rng = np.random.default_rng(2)
    sides = [turn([np.cos(phi), np.sin(phi), 0.0], 0.7) for phi in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)]
    tilted = [seen(side, np.array([0.0, 0.0, 0.8]), f"tilt{i}", rng) for i, side in enumerate(sides)]
    flat = [seen(np.eye(3), np.array([0.0, 0.0, 0.8]), f"flat{i}", rng) for i in range(60)]
    assert set(range(60, 68)) <= set(spread_out([*flat, *tilted], PAPER.size)[:FEWEST_VIEWS])
    sights = np.array([sight_of(view, PAPER.size) for view in tilted])
    assert np.abs(sights[:4, 3:] + sights[4:, 3:]).max() < 0.05, "opposite tilts have opposite signs"


def test_few_views_are_all_used_and_many_are_bounded():
    rng = np.random.default_rng(3)
    same = [seen(np.eye(3), np.array([0.0, 0.0, 0.8]), f"{i}", rng) for i in range(60)]
    assert sorted(spread_out(same[:10], PAPER.size)) == list(range(10))
    assert len(spread_out(same, PAPER.size)) == FEWEST_VIEWS
    places = [(x, y, 0.8) for x in np.linspace(-0.35, 0.35, 9) for y in (-0.25, 0.0, 0.25)]
    everywhere = [seen(turn([1, 0, 0], a), np.array(at), "", rng) for a in (-0.8, 0.0, 0.8) for at in places]
    assert len(spread_out(everywhere, PAPER.size)) == MOST_VIEWS
    assert spread_out([], PAPER.size) == []


@pytest.mark.slow
def test_a_video_names_the_frames_that_are_used_and_why_others_are_not(tmp_path, chess_folder):
    """Twelve poses, each held for forty frames with a trembling camera."""
    rng, path = np.random.default_rng(4), tmp_path / "board.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30.0, (320, 240))
    for file in sorted(chess_folder.iterdir()):
        still = cv2.imread(str(file))
        for _ in range(40):
            shift = np.array([[1, 0, rng.uniform(-3, 3)], [0, 1, rng.uniform(-3, 3)]])
            writer.write(cv2.warpAffine(still, shift, (320, 240), borderMode=cv2.BORDER_REPLICATE))
    writer.release()
    taken, said = pictures_of([str(path)], steps)
    assert said.startswith("120 of 480 frames are searched, the sharpest of each piece of the video;")
    found = find_board(taken, parse_board("chessboard:7x5:25mm"), lambda _known: None)
    poses = {int(view.name.rpartition(" ")[2]) // 40 for view in found.views}
    assert len(poses) >= 11
    assert FEWEST_VIEWS <= len(found.views) <= MOST_VIEWS
    assert found.crowded
    assert {found.unused[name] for name in found.crowded} == {"near to the view of another frame"}
    assert found.pictures == len(taken)
