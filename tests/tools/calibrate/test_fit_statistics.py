"""The claim, judged from both sides over many draws of the noise: errors squared over claimed variance."""

import numpy as np
import pytest
from drawn_boards import PAPER, WIDE, views
from draws import first_of

from fwav_companion.tools.calibrate.lens_fit.lens_accuracy import lens_accuracy
from fwav_companion.tools.calibrate.lens_fit.outliers import consistent_views
from fwav_companion.tools.calibrate.lens_fit.polynomial_order import select_order
from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardView, concatenated

DRAWS = [10, pytest.param(25, marks=pytest.mark.slow)]
NOISE_PX = 0.1
TIMES = 3.29
"""99.9 % of a normal variable lie within this number of sigmas of its mean."""
LENSES = {"the paper's": (PAPER, 0.4, 0.35), "200 degrees": (WIDE, 1.3, 0.8)}


def claims(draws, lens, reach, share, spoil):
    """For each draw: its normalised square, how many numbers were fitted, and the claim."""
    rng = np.random.default_rng(11)
    clean = [BoardView(*view) for view in views(lens, rng, 10, reach=reach, share=share, noise=0.0, board=(6, 4, 0.04))]
    start = consistent_views(clean, lens.size).state
    for _ in range(draws):
        corners = concatenated([BoardView(view.name, view.board, spoil(view.pixels, rng)) for view in clean])
        fit = select_order(corners, start)
        claimed = lens_accuracy(corners, fit.state, fit.variance)
        truth = np.array([*lens.centre, lens.aspect, *lens.c, 0.0, 0.0, 0.0])[: len(fit.state.lens)]
        error = fit.state.lens - truth
        yield error @ np.linalg.solve(claimed.covariance, error), len(truth), claimed.inflation


def noise(pixels, rng):
    return pixels + rng.normal(0.0, NOISE_PX, pixels.shape)


def bent(pixels, rng):
    """The pixels with one bend for all corners of a picture, different in each picture: a sheet that is not flat."""
    x, y = ((pixels - pixels.mean(axis=0)) / pixels.std()).T
    return noise(pixels, rng) + NOISE_PX * (np.outer(x * y, rng.normal(size=2)) + np.outer(x * x, rng.normal(size=2)))


@pytest.mark.parametrize("draws", DRAWS)
@pytest.mark.parametrize("name", first_of("200 degrees", "the paper's"))
def test_errors_are_as_large_as_claimed(name, draws):
    squares, numbers, _ = zip(*claims(draws, *LENSES[name], noise), strict=True)
    free = np.array(numbers, dtype=float)
    spread = np.sqrt(2.0 * free.sum())
    assert abs(sum(squares) - free.sum()) < TIMES * spread
    assert max(squares) < 33.0  # one in ten thousand, of chi2 with 8


@pytest.mark.parametrize("draws", DRAWS)
@pytest.mark.parametrize("name", first_of("200 degrees", "the paper's"))
def test_errors_that_pictures_share_are_claimed_too(name, draws):
    """Believing in the corners' scatter alone would claim the square of the widening too little."""
    squares, numbers, widened = zip(*claims(draws, *LENSES[name], bent), strict=True)
    free, scatter = sum(numbers), np.mean(np.square(widened))
    assert scatter > 2.0
    assert 0.4 * free < sum(squares) < 1.6 * free
