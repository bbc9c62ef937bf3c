"""The sigma of a marker and of a coloured panel is true: on rendered scenes of known truth the normalised square of its
error is 1, in each class of size and blur."""

import cv2
import numpy as np
import pytest
from rendered_scenes import blob_scene, marker_scene

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


@pytest.mark.slow
@pytest.mark.parametrize("blur", BLURS)
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_normalised_square_is_one_in_each_class(kind, size, blur):
    found = squares(kind, size, blur, 400, seed=77, least=151)
    assert len(found) > 150
    assert 0.8 < found.mean() < 1.25


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


@pytest.mark.slow
@pytest.mark.parametrize("blur", BLOB_BLURS)
@pytest.mark.parametrize("size", BLOB_SIZES)
def test_the_normalised_square_of_a_coloured_panel_is_one_in_each_class(size, blur):
    found = blob_squares(size, blur, 300, seed=78)
    assert len(found) > 290
    assert 0.8 < found.mean() < 1.25


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
