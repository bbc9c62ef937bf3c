"""Detectors on pictures whose targets are where they were drawn."""

from math import hypot

import cv2
import numpy as np
import pytest
from vision_pictures import tag_picture

from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.detectors.color import ColorDetector
from fwav_companion.vision.detectors.markers import APRILTAG_FAMILIES, ARUCO_DICTIONARIES, apriltags, aruco
from fwav_companion.vision.task import VisionTask


@pytest.mark.parametrize("centre", [(320.0, 240.0), (101.3, 77.8), (560.5, 400.25)])
@pytest.mark.parametrize("side_px", [32.0, 60.0, 110.0])
def test_a_tag_is_found_at_its_centre_within_what_it_claims(centre, side_px):
    (found,) = apriltags().detect(tag_picture(centre, side_px=side_px))
    assert found["label"] == "tag36h11:7"
    assert found["id"] == 7
    assert hypot(found["u"] - centre[0], found["v"] - centre[1]) < max(0.15, 4.0 * found["sigma"])
    assert 0.03 < found["sigma"] < 0.3
    left, top, right, bottom = found["box"]
    assert left < centre[0] < right
    assert top < centre[1] < bottom
    assert right - left == pytest.approx(side_px * 1.282, rel=0.1)  # turned by 20 degrees


def test_perspective_keeps_the_crossing_of_diagonals_where_the_mean_of_corners_moves():
    picture = tag_picture((300.0, 200.0), side_px=90.0, tilt=0.25)
    (found,) = apriltags().detect(picture)
    assert hypot(found["u"] - 300.0, found["v"] - 200.0) < 0.4
    left, top, right, bottom = found["box"]
    assert hypot((left + right) / 2 - 300.0, (top + bottom) / 2 - 200.0) > 2.0


@pytest.mark.parametrize("turn_deg", [0.0, 20.0, 110.0, 200.0])
def test_corners_are_those_of_the_black_square_in_the_order_of_the_print(turn_deg):
    (found,) = apriltags().detect(tag_picture((320.0, 240.0), side_px=90.0, turn_deg=turn_deg))
    c, s = 45.0 * np.cos(np.radians(turn_deg)), 45.0 * np.sin(np.radians(turn_deg))
    drawn = [(320.0 + x * c - y * s, 240.0 + x * s + y * c) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    assert np.allclose(found["corners"], drawn, atol=0.5)


def test_sigma_grows_with_motion_blur():
    sigmas = [apriltags().detect(tag_picture(side_px=80.0, blur_px=blur))[0]["sigma"] for blur in (0, 5, 9)]
    assert sigmas[0] < 0.4
    assert sigmas == sorted(sigmas)
    assert sigmas[2] > 0.6


def test_another_family_is_no_tag_of_ours():
    picture = tag_picture(dictionary=cv2.aruco.DICT_4X4_50, modules=6)
    assert apriltags().detect(picture) == []
    (found,) = aruco("4x4_50").detect(picture)
    assert found["label"] == "aruco:7"
    assert hypot(found["u"] - 320.0, found["v"] - 240.0) < 0.4


@pytest.mark.parametrize("family", APRILTAG_FAMILIES)
def test_each_family_of_opencv_is_found(family):
    dictionary, modules = APRILTAG_FAMILIES[family]
    picture = tag_picture((300.0, 200.0), dictionary=dictionary, modules=modules, number=3)
    (found,) = [each for each in apriltags(family).detect(picture) if each["id"] == 3]
    assert found["label"] == f"tag{family}:3"
    assert (found["u"], found["v"]) == pytest.approx((300.0, 200.0), abs=0.3)


def test_every_family_of_opencv_may_be_named():
    of_opencv = {name.removeprefix("DICT_APRILTAG_").lower() for name in dir(cv2.aruco) if "DICT_APRILTAG_" in name}
    assert set(APRILTAG_FAMILIES) == of_opencv


def test_every_dictionary_that_may_be_named_is_opencvs():
    assert len(ARUCO_DICTIONARIES) == 16
    for name in ARUCO_DICTIONARIES:
        assert aruco(name).detect(np.full((48, 64), 128, np.uint8)) == []


def test_a_patch_of_the_hue_is_found_and_others_are_not():
    picture = np.full((480, 640, 3), (90, 110, 100), np.uint8)
    cv2.circle(picture, (200, 150), 12, (20, 30, 230), -1)
    cv2.circle(picture, (400, 300), 12, (230, 30, 20), -1)
    (red,) = ColorDetector(0.0).detect(picture)
    assert (red["u"], red["v"]) == pytest.approx((200.0, 150.0), abs=0.1)
    (blue,) = ColorDetector(240.0).detect(picture)
    assert (blue["u"], blue["v"]) == pytest.approx((400.0, 300.0), abs=0.1)
    assert red["sigma"] == pytest.approx(0.25 / (12 * np.pi**0.5) ** 0.5, rel=0.1)
    assert ColorDetector(120.0).detect(picture) == []
    assert ColorDetector(0.0).detect(picture[:, :, 0].copy()) == []


def test_the_task_names_the_detector():
    assert (
        make_detector(VisionTask("x", detector="color", color_hue_deg=240.0)).detect(np.zeros((9, 9), np.uint8)) == []
    )
    picture = tag_picture(dictionary=cv2.aruco.DICT_5X5_100, modules=7)
    assert make_detector(VisionTask("x", detector="aruco", aruco_dictionary="5x5_100")).detect(picture)
    assert make_detector(VisionTask("x")).detect(tag_picture())
