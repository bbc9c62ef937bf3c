"""Makes the helpers in this folder importable; pictures that several tests use are drawn once."""

import sys
from pathlib import Path

import cv2
import pytest

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from drawn_boards import PAPER, chess_grey, half_size, picture, poses


@pytest.fixture(scope="session")
def chess_folder(tmp_path_factory):
    """Twelve pictures of 320x240 of a 7x5 chessboard, by half of the paper's lens."""
    folder = tmp_path_factory.mktemp("chess")
    rng = np.random.default_rng(3)
    places = poses(rng, 12, 0.2, reach=0.33, share=0.4, tilt=0.9)
    for i, pose in enumerate(places):
        cv2.imwrite(str(folder / f"{i:02d}.png"), picture(half_size(PAPER), pose, chess_grey(7, 5, 0.025), rng))
    return folder
