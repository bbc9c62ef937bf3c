"""What is thin or wrong in a calibration is said, with what to do; of a good one nothing is said."""

from dataclasses import dataclass

import numpy as np
import pytest
from drawn_boards import PAPER, WIDE, TrueLens, views

from fwav_companion.tools.calibrate.lens_fit.corners import View
from fwav_companion.tools.calibrate.lens_fit.fit import Fitted, fit_lens
from fwav_companion.tools.calibrate.verdict import covered, least_mount_bias_deg, least_pixel_noise_px, notes


@dataclass(frozen=True)
class Decentred(TrueLens):
    """Brown's tangential terms on top, about the principal point."""

    p: float = 0.0

    def pixels(self, points):
        pixels = super().pixels(points)
        x, y = np.moveaxis((pixels - np.array(self.centre)) / self.c[0], -1, 0)
        moved = [2 * self.p * x * y, self.p * (x * x + 3 * y * y)]
        return pixels + self.c[0] * np.stack(moved, axis=-1)


def fitted(lens=WIDE, count=30, seed=1, *, reach=1.5, share=0.8, noise=0.1, spoil=lambda view, rng: view):
    rng = np.random.default_rng(seed)
    seen = [View(*view) for view in views(lens, rng, count, reach=reach, share=share, noise=noise)]
    result = fit_lens([spoil(view, rng) for view in seen], lens.size)
    assert isinstance(result, Fitted), result
    return result


def told(result):
    return " | ".join(notes(result))


def test_nothing_is_said_of_good_pictures():
    result = fitted()
    assert told(result) == ""
    with_corners, parts = covered(result)
    assert with_corners > 0.9 * parts
    assert least_pixel_noise_px(result) == pytest.approx(0.1, abs=0.11)
    assert 0.02 < least_mount_bias_deg(result) < 0.3


def test_corners_in_the_middle_only():
    result = fitted(PAPER, reach=0.1, share=0.25)
    said = told(result)
    assert "of the image's 34° from the axis" in said
    assert "will be refused" in said
    assert "parts of the image: show the board in the others too" in said


def test_few_pictures():
    assert "7 pictures: 15 to 30" in told(fitted(count=7, reach=1.2))


def test_corners_that_miss_by_much():
    """And where rays are a degree unsure, near to where this lens folds, the file ends."""
    result = fitted(noise=1.2)
    assert "corners miss by 1.2 px" in told(result)
    assert result.claim.supported < result.claim.reached
    _, beside = result.ray_sigmas(np.array([0.95, 1.1]) * result.claim.supported)
    assert np.degrees(beside[0]) < 1.0 < np.degrees(beside[1])


def test_sheets_that_bend_from_picture_to_picture():
    def bent(view, rng):
        x, y = ((view.pixels - view.pixels.mean(axis=0)) / view.pixels.std()).T
        return View(view.name, view.board, view.pixels + 0.3 * np.outer(x * y, rng.normal(size=2)))

    result = fitted(spoil=bent)
    assert result.claim.disagreement > 2.0
    assert "pictures disagree by" in told(result)


def test_a_print_that_was_scaled_one_way():
    """By two percent, and held upright in every picture: pixels seem to be no squares."""
    said = told(fitted(TrueLens(WIDE.c, WIDE.centre, WIDE.size, 1.02, WIDE.sees)))
    assert "2.0 % off square" in said


def test_a_lens_that_is_not_centred():
    lens = Decentred(WIDE.c, WIDE.centre, WIDE.size, WIDE.aspect, WIDE.sees, p=2e-3)
    result = fitted(lens)
    edge_px = 3.0 * 2e-3 * lens.radius(result.claim.reached) ** 2 / lens.c[0]
    assert result.decentring.edge_px == pytest.approx(edge_px, abs=max(4.0 * result.decentring.sigma_px, 0.3 * edge_px))
    assert "not centred on one axis" in told(result)
