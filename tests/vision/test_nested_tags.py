"""A landing pad of two nested tags, seen from ten metres to less than half a metre."""

import cv2
import numpy as np
import pytest

from fwav_companion.vision.detectors.markers import apriltags

OUTER_M, INNER_M, FOCAL_PX = 0.6, 0.06, 600.0
DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
SCALE = 40
"""Fine pixels of a module of the outer tag."""


def pad(outer=3, inner=9):
    """The inner tag in the middle of the outer one, with a white margin; and the size of the whole in outer modules."""
    large = cv2.resize(
        np.pad(cv2.aruco.generateImageMarker(DICTIONARY, outer, 8), 1, constant_values=255),
        None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_NEAREST,
    )  # fmt: skip
    side = round(8 * SCALE * INNER_M / OUTER_M / 8) * 8
    small = cv2.copyMakeBorder(
        cv2.aruco.generateImageMarker(DICTIONARY, inner, side), *(side // 8,) * 4, cv2.BORDER_CONSTANT, value=255
    )
    middle, half = large.shape[0] // 2, small.shape[0] // 2
    large[middle - half : middle - half + small.shape[0], middle - half : middle - half + small.shape[1]] = small
    return large


def seen_from(height_m, flat, shift=(0.0, 0.0), size=(640, 480)):
    """A picture from straight above, and the pixel of the pad's middle."""
    per_px = FOCAL_PX / height_m * OUTER_M / (8 * SCALE)
    centre = np.array([0.5 * size[0] + shift[0], 0.5 * size[1] + shift[1]])
    offset = centre - per_px * 0.5 * np.array(flat.shape[::-1])
    matrix = np.array([[per_px, 0.0, offset[0]], [0.0, per_px, offset[1]]])
    flags = cv2.INTER_AREA if per_px < 1.0 else cv2.INTER_LINEAR
    if per_px < 1.0:  # first the size, without aliasing, then the place
        n = max(1, round(flat.shape[0] * per_px))
        flat = cv2.resize(flat, (n, n), interpolation=flags)
        matrix = np.array([[1.0, 0.0, centre[0] - 0.5 * n], [0.0, 1.0, centre[1] - 0.5 * n]])
    picture = cv2.warpAffine(flat, matrix, size, flags=cv2.INTER_LINEAR, borderValue=150)
    noise = np.random.default_rng(round(100 * height_m)).normal(0.0, 2.0, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8), centre - 0.5


def descent():
    return np.geomspace(9.0, 0.35, 40)


def test_a_pad_is_one_target_to_the_last_half_metre():
    detector, flat, labels, missed = apriltags(), pad(), set(), 0
    for height_m in descent():
        picture, middle = seen_from(height_m, flat)
        found = detector.detect(picture)
        assert len(found) <= 1, height_m
        missed += not found
        for each in found:
            labels.add((each["label"], each["id"]))
            assert (each["u"], each["v"]) == pytest.approx(tuple(middle), abs=1.5), height_m
    assert labels == {("tag36h11:3", 3)}
    assert missed <= 2
    assert detector.detect(seen_from(0.35, flat)[0]), "the outer tag does not fit into the image from here"


def test_two_tags_beside_one_another_stay_two():
    detector = apriltags()
    picture = np.full((480, 640), 150, np.uint8)
    for number, left in ((3, 60), (9, 350)):
        marker = np.pad(cv2.aruco.generateImageMarker(DICTIONARY, number, 160), 20, constant_values=255)
        picture[100:300, left : left + 200] = marker
    for _ in range(8):
        assert {each["label"] for each in detector.detect(picture)} == {"tag36h11:3", "tag36h11:9"}


def test_tag_of_a_pad_keeps_its_own_label_in_another_tag():
    """[[pad]] has the place and the size of each: the small one is not reported under the large one's label."""
    detector, flat, labels = apriltags(apart=("tag36h11:3", "tag36h11:9")), pad(), []
    for height_m in descent():
        labels += [each["label"] for each in detector.detect(seen_from(height_m, flat)[0])]
    assert labels[0] == "tag36h11:3"
    assert labels[-1] == "tag36h11:9"
