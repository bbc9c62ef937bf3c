"""OpenCV's own fisheye calibration on the same corners, inside the angles that it is made for, as a second opinion."""

import cv2
import numpy as np
import pytest
from drawn_boards import WIDE, views

from fwav_companion.tools.calibrate.lens_fit.bundle_adjustment import adjusted, residuals
from fwav_companion.tools.calibrate.lens_fit.initial_estimate import initial_estimate
from fwav_companion.tools.calibrate.lens_fit.reprojection import (
    BoardView,
    LensAndPoses,
    concatenated,
    project,
    with_coefficients,
)


@pytest.fixture(scope="module")
def both():
    """Our state of five coefficients, OpenCV's as the same numbers, and the corners."""
    seen = [BoardView(*view) for view in views(WIDE, np.random.default_rng(4), 14, reach=0.9, share=0.7)]
    corners = concatenated(seen)
    state = initial_estimate(corners, WIDE.size)
    for count in range(2, 6):
        state = adjusted(corners, with_coefficients(state, count), np.ones(len(corners.pixels)), 60)
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
    board = [np.c_[view.board, np.zeros(len(view.board))].reshape(1, -1, 3) for view in seen]
    pixels = [view.pixels.reshape(1, -1, 2) for view in seen]
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    K, D = np.array([[200.0, 0.0, 320.0], [0.0, 200.0, 240.0], [0.0, 0.0, 1.0]]), np.zeros((4, 1))
    flags |= cv2.CALIB_USE_INTRINSIC_GUESS
    rms, K, D, turns, places = cv2.fisheye.calibrate(board, pixels, WIDE.size, K, D, flags=flags, criteria=stop)
    focal = K[0, 0]
    lens = np.array([K[0, 2], K[1, 2], K[1, 1] / focal, focal, *(focal * D.ravel())])
    theirs = LensAndPoses(
        lens,
        np.array([cv2.Rodrigues(turn)[0] for turn in turns]),
        np.array([np.ravel(place) for place in places]),
    )
    return corners, state, theirs, rms


def test_our_sum_of_squares_is_no_larger(both):
    corners, ours, theirs, rms = both
    squares, reference = (float((residuals(corners, state) ** 2).sum()) for state in (ours, theirs))
    assert reference == pytest.approx(rms**2 * len(corners.pixels), rel=1e-6)
    assert squares <= reference * (1.0 + 1e-6)


def test_both_give_the_same_rays(both):
    _, ours, theirs, _ = both
    theta, phi = np.meshgrid(np.linspace(0.0, 1.1, 12), np.linspace(0.0, 6.0, 12))
    rays = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1).reshape(-1, 3)
    assert np.abs(project(ours.lens, rays)[0] - project(theirs.lens, rays)[0]).max() < 0.02
