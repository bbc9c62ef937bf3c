"""The sigma of a marker and of a coloured panel is true: on rendered scenes of known truth the normalised square of its
error is 1, in each class of size and blur."""

import cv2
import numpy as np
import pytest
from draws import first_rows_of, slow_of
from rendered_scenes import blob_scene, marker_scene
from scipy.stats import chi2

from fwav_companion.vision.detectors.color import ColorDetector
from fwav_companion.vision.detectors.color_sigma import blob_sigma_px
from fwav_companion.vision.detectors.marker_sigma import MODULES_PX, SIGMAS_PX, WIDTHS, marker_sigma_px
from fwav_companion.vision.detectors.markers import apriltags, aruco

KINDS = {
    "apriltag": (apriltags, cv2.aruco.DICT_APRILTAG_36h11, 8),
    "aruco": (lambda: aruco("4x4_50"), cv2.aruco.DICT_4X4_50, 6),
}
SIZES = {"small": (20.0, 32.0), "middle": (32.0, 60.0), "large": (60.0, 120.0)}
BLURS = {"sharp": (0.0, 0.0), "slightly blurred": (0.05, 0.6), "blurred": (0.6, 1.2), "badly blurred": (1.2, 1.8)}
"""Motion in modules of the marker."""
MOST_DRAWS = 1500


def squares(kind, size, blur, draws, seed, least=0):
    """Normalised squares of both axes of those that are found; more are drawn while these are fewer than ``least``."""
    make, dictionary, modules = KINDS[kind]
    detector, rng, found = make(), np.random.default_rng(seed), []
    for draw in range(MOST_DRAWS):
        if draw >= draws and len(found) >= least:
            break
        side_px = np.exp(rng.uniform(*np.log(SIZES[size])))
        blur_px = rng.uniform(*BLURS[blur]) * side_px / modules
        scene = marker_scene(rng, side_px, dictionary=dictionary, modules=modules, blur_px=blur_px)
        for each in detector.detect(scene.picture)[:1]:
            off = np.array([each["u"] - scene.centre[0], each["v"] - scene.centre[1]])
            found.append(off @ off / each["sigma"] ** 2 / 2.0)
    return np.array(found)


def assert_one_in_each(found, *, full):
    """The mean square of each class is 0.8 to 1.25: of all draws exactly, of a share of them as well as these can show.

    A claim of half or twice the error is a mean of 4 or 0.25. All classes together are as many draws as one of all.
    """
    assert 0.8 < np.concatenate([*found.values()]).mean() < 1.25
    for name, each in found.items():
        low, high = (1.0, 1.0) if full else chi2.ppf([0.0005, 0.9995], 2 * len(each)) / (2 * len(each))
        assert 0.8 * low < each.mean() < 1.25 * high, name


@pytest.mark.parametrize(("draws", "least"), first_rows_of((60, 40), (400, 151), few=0, some=1))
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_normalised_square_is_one_in_each_class(kind, size, draws, least):
    found = {blur: squares(kind, size, blur, draws, seed=77, least=least) for blur in BLURS}
    assert min(map(len, found.values())) >= least
    assert_one_in_each(found, full=draws == 400)


BLOB_SIZES = {"small": (6.0, 15.0), "middle": (15.0, 40.0), "large": (40.0, 110.0)}
BLOB_BLURS = {"sharp": (0.0, 0.0), "slightly blurred": (0.02, 0.3), "blurred": (0.3, 0.9)}
"""Motion in sides of the blob."""


def blob_squares(size, blur, draws, seed):
    """Normalised squares of both axes of coloured panels."""
    detector, rng, found = ColorDetector(0.0), np.random.default_rng(seed), []
    for _ in range(draws):
        side_px = np.exp(rng.uniform(*np.log(BLOB_SIZES[size])))
        scene = blob_scene(rng, side_px, blur_px=rng.uniform(*BLOB_BLURS[blur]) * side_px)
        for each in detector.detect(scene.picture)[:1]:
            off = np.array([each["u"] - scene.centre[0], each["v"] - scene.centre[1]])
            found.append(off @ off / each["sigma"] ** 2 / 2.0)
    return np.array(found)


@pytest.mark.parametrize("draws", slow_of(60, 300, few=1))
@pytest.mark.parametrize("size", BLOB_SIZES)
def test_the_normalised_square_of_a_coloured_panel_is_one_in_each_class(size, draws):
    found = {blur: blob_squares(size, blur, draws, seed=78) for blur in BLOB_BLURS}
    assert min(map(len, found.values())) > 0.96 * draws
    assert_one_in_each(found, full=draws == 300)


def test_a_coloured_panel_is_claimed_to_a_tenth_of_a_pixel_and_holds_it():
    found = blob_squares("small", "sharp", 60, seed=6)
    assert len(found) > 50
    assert 0.6 < found.mean() < 1.5
    assert blob_sigma_px(100.0, 0.1) < 0.1 < blob_sigma_px(100.0, 0.5)


def test_the_table_is_met_at_its_nodes_and_bounded_beyond():
    for row, module_px in enumerate(MODULES_PX):
        for column, width in enumerate(WIDTHS):
            assert marker_sigma_px(module_px, width * module_px) == pytest.approx(SIGMAS_PX[row][column], rel=1e-9)
    assert marker_sigma_px(0.5, 9.0) == pytest.approx(SIGMAS_PX[0][-1])
    assert marker_sigma_px(90.0, 2.0) == pytest.approx(SIGMAS_PX[-1][0])


@pytest.mark.slow
def test_a_sharp_large_tag_is_claimed_to_hundredths_of_a_pixel_and_holds_it():
    found = squares("apriltag", "large", "sharp", 60, seed=5)
    assert len(found) > 50
    assert 0.6 < found.mean() < 1.5
