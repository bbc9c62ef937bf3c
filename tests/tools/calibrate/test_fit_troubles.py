"""Corners and pictures that are wrong, and sets of pictures that show too little: thrown out by name, or refused."""

import numpy as np
import pytest
from drawn_boards import NARROW, PAPER, views

from fwav_companion.tools.calibrate.lens_fit.lens_fit import FailedFit, FitFailure, FittedLens, fit_lens
from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardView

SIZE = PAPER.size


def good(count=12, seed=2, lens=PAPER, **where):
    where = {"reach": 0.42, "share": 0.35, **where}
    return [BoardView(*view) for view in views(lens, np.random.default_rng(seed), count, **where)]


def with_pixels(view, pixels):
    return BoardView(view.name, view.board, pixels)


def test_a_few_bad_corners_and_a_bad_picture_are_thrown_out_by_name():
    seen = good()
    clean = fit_lens(seen, SIZE)
    spoilt = list(seen)
    bad = seen[3].pixels.copy()
    bad[[2, 20]] += (6.0, -4.0), (0.0, 1.5)
    spoilt[3] = with_pixels(seen[3], bad)
    spoilt[7] = with_pixels(seen[7], seen[7].pixels[::-1] * (1.0, 0.98))  # misread, from the other end
    squeezed = seen[8].pixels.copy()
    squeezed[:, 0] += 3.0 * np.sin(squeezed[:, 1] / 20.0)  # a sheet in the wind
    spoilt[8] = with_pixels(seen[8], squeezed)
    found = fit_lens(spoilt, SIZE)
    assert isinstance(clean, FittedLens)
    assert isinstance(found, FittedLens)
    assert {dropped.name for dropped in found.dropped} == {seen[7].name, seen[8].name}
    assert all("times the usual one" in dropped.why for dropped in found.dropped)
    assert {view.view.name: view.corners_out for view in found.views if view.corners_out} == {seen[3].name: 2}
    error = found.lens - np.array([*PAPER.centre, PAPER.aspect, *PAPER.c])
    assert error @ np.linalg.solve(found.accuracy.covariance, error) < 20.5  # 99.9 % of chi2 with 5
    assert found.noise_px == pytest.approx(clean.noise_px, rel=0.1)


def test_of_good_pictures_nothing_is_thrown_out():
    for seed in range(4):
        found = fit_lens(good(seed=seed), SIZE)
        assert not found.dropped
        assert not any(view.corners_out for view in found.views)


def test_too_few_pictures():
    found = fit_lens(good()[:4], SIZE)
    assert isinstance(found, FailedFit)
    assert found.why is FitFailure.TOO_FEW_VIEWS
    assert "in 4; at least 5 are needed" in found.detail


def test_none_at_all():
    found = fit_lens([], SIZE)
    assert (found.why, found.dropped) == (FitFailure.TOO_FEW_VIEWS, ())


def test_corners_that_are_no_numbers_or_too_few_are_named():
    seen = good()[:6]
    seen[1] = with_pixels(seen[1], seen[1].pixels * np.nan)
    seen[2] = BoardView(seen[2].name, seen[2].board[:5], seen[2].pixels[:5])
    found = fit_lens(seen, SIZE)
    assert found.why is FitFailure.TOO_FEW_VIEWS
    assert [dropped.name for dropped in found.dropped] == [seen[1].name, seen[2].name]


@pytest.mark.parametrize("lens", [PAPER, NARROW], ids=["the paper's", "narrow"])
def test_boards_that_are_all_parallel_are_refused_as_that(lens):
    """The same board from further away, farther left, and turned in its plane."""
    seen, rng = good(1, lens=lens)[0], np.random.default_rng(1)
    x, y = seen.board.T
    copies = []
    for i in range(8):
        turn = 0.3 * i
        flat = np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, 0.0 * x], axis=1)
        points = flat + np.array([0.01 * i - 0.04, 0.005 * i, (0.7 + 0.05 * i) * lens.c[0] / PAPER.c[0]])
        copies.append(BoardView(str(i), seen.board, lens.pixels(points) + rng.normal(0.0, 0.1, (len(points), 2))))
    found = fit_lens(copies, lens.size)
    assert isinstance(found, FailedFit)
    assert found.why in {FitFailure.SAME_TILT, FitFailure.UNDETERMINED}


def test_the_same_picture_eight_times_is_refused_as_one_tilt():
    seen = good()[2]
    found = fit_lens([BoardView(str(i), seen.board, seen.pixels) for i in range(8)], SIZE)
    assert found.why is FitFailure.SAME_TILT
    assert "tilt the board by 30°" in found.detail


HOSTILE = {
    "anywhere": lambda view, rng: rng.uniform(0.0, 400.0, view.pixels.shape),
    "all in one point": lambda view, rng: view.pixels * 0.0 + 100.0,
    "all in one line": lambda view, rng: view.pixels * (1.0, 0.0) + 100.0,
    "far outside": lambda view, rng: view.pixels * 1e9,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_corners_without_sense_are_refused(name):
    rng = np.random.default_rng(6)
    found = fit_lens([with_pixels(view, HOSTILE[name](view, rng)) for view in good()], SIZE)
    assert isinstance(found, FailedFit)
    assert found.detail


def test_a_board_of_the_wrong_shape_is_refused():
    """Squares that are a third too long one way."""
    found = fit_lens([BoardView(view.name, view.board * (1.0, 1.33), view.pixels) for view in good()], SIZE)
    assert isinstance(found, FailedFit)


def test_the_same_blur_is_more_pixels_wide_in_a_larger_picture():
    """3 px are refused in 640 pixels, and accepted in 3840."""
    times = 6
    seen = good(24, noise=0.5)
    large = [with_pixels(view, (view.pixels + 0.5) * times - 0.5) for view in seen]
    assert isinstance(fit_lens(large, (SIZE[0] * times, SIZE[1] * times)), FittedLens)
    rough = fit_lens(good(24, noise=3.0), SIZE)
    assert isinstance(rough, FailedFit)
    assert rough.why is FitFailure.MISFIT
    assert "the reprojection error is 3." in rough.detail or "the reprojection error is 2." in rough.detail
