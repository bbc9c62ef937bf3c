"""The point of a standing thing that a detection marks, against projections of its own geometry."""

from math import radians

import msgspec
import numpy as np
import pytest
from handmade import a_fix
from scipy.spatial.transform import Rotation

from fwav_companion.camera import KannalaBrandt
from fwav_companion.pairing.anchors import anchor_of, anchored, foot_pixel, marker_centre
from fwav_companion.types import Detection, ElevatedTarget

LENS = KannalaBrandt((1.0, 0.02, -0.003), (200.0, 201.0), (400.0, 398.0), (800, 800))
DOWNWARD = Rotation.from_matrix([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
"""Image top to the nose."""


def pole(angle_deg, azimuth_deg, roll_deg=0.0, pitch_deg=0.0, height_m=1.7, camera_m=10.0):
    """(ned_from_camera, pixels from foot to head) of a pole that far from the nadir."""
    ned_from_camera = Rotation.from_euler("YX", [pitch_deg, roll_deg], degrees=True) * DOWNWARD
    away = camera_m * np.tan(radians(angle_deg))
    north, east = away * np.cos(radians(azimuth_deg)), away * np.sin(radians(azimuth_deg))
    points = [np.array([north, east, camera_m - h]) for h in np.linspace(0.0, height_m, 30)]
    pixels = [LENS.pixel_from_camera_point(tuple(ned_from_camera.inv().apply(point))) for point in points]
    return tuple(map(tuple, ned_from_camera.as_matrix())), np.array(pixels)


def box_of(pixels):
    (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
    return (left - 1.0, top - 1.0, right + 1.0, bottom + 1.0)


@pytest.mark.parametrize("roll_deg", [0.0, 25.0])
@pytest.mark.parametrize("azimuth_deg", [0.0, 90.0, 180.0, 270.0])
@pytest.mark.parametrize("angle_deg", [20.0, 37.0, 55.0, 70.0])
def test_the_foot_of_a_pole_is_where_its_box_ends_toward_the_nadir(angle_deg, azimuth_deg, roll_deg):
    """Of a camera that looks down: ahead it is the lower edge of the box, behind the upper one, aside a side."""
    ned_from_camera, pixels = pole(angle_deg, azimuth_deg, roll_deg)
    box = box_of(pixels)
    foot = foot_pixel(Detection(0.0, 0.0, box=box), ned_from_camera, LENS)
    assert foot == pytest.approx(tuple(pixels[0]), abs=3.0)
    edges = {0.0: box[3], 180.0: box[1]} if roll_deg == 0.0 else {}
    if azimuth_deg in edges:
        assert foot[1] == pytest.approx(edges[azimuth_deg], abs=0.01)


def seen(detection, ned_from_camera):
    """The sighting of a detection by a camera of this attitude."""
    ray = LENS.camera_ray_and_derivatives_from_pixel(400.0, 398.0)
    sighting = a_fix(0.0, (0.0, 0.0, 0.0)).sighting
    return msgspec.structs.replace(
        sighting, detection=detection, ray=ray, ned_from_camera=ned_from_camera, pixel_sigma=detection.sigma
    )


@pytest.mark.parametrize(("azimuth_deg", "axis"), [(0.0, 1), (180.0, 1), (90.0, 0), (270.0, 0)])
def test_the_edge_that_shows_the_foot_is_less_certain_than_the_centre(azimuth_deg, axis):
    """The pole's image runs along v ahead and behind, along u aside: across that edge the sigma is 1.5 to 2 times."""
    ned_from_camera, pixels = pole(40.0, azimuth_deg)
    person = ElevatedTarget(label="person", height_m=1.7, anchor="bottom")
    detection = Detection(1.0, 1.0, sigma=(2.0, 3.0), box=box_of(pixels))
    found = anchored(seen(detection, ned_from_camera), person, LENS)
    expected = [2.0, 3.0]
    expected[axis] *= found.pixel_sigma[axis] / expected[axis]
    assert found.pixel_sigma == pytest.approx(expected)
    assert 1.5 <= found.pixel_sigma[axis] / (2.0, 3.0)[axis] <= 2.0
    assert found.anchor_height_m == 0.0
    assert found.anchor_sigma_m == pytest.approx(1.7 * np.sqrt(0.1**2 / 3.0), rel=0.01), "ends 0 to 10 % early"
    centred = anchored(seen(detection, ned_from_camera), msgspec.structs.replace(person, anchor="center"), LENS)
    assert centred.pixel_sigma == (2.0, 3.0)


@pytest.mark.parametrize(
    ("name", "angle_deg", "shift"),
    [("near the nadir", 8.0, 0.0), ("cut off at the top", 60.0, None), ("no box", 40.0, 0.0)],
)
def test_where_the_box_shows_no_foot_its_centre_counts(name, angle_deg, shift):
    ned_from_camera, pixels = pole(angle_deg, 0.0)
    box = box_of(pixels)
    if shift is None:
        box = (box[0], -0.5, box[2], box[3])
    detection = Detection(1.0, 1.0, box=None if name == "no box" else box)
    person = ElevatedTarget(label="person", height_m=1.7, anchor="bottom")
    anchor = anchor_of(person, detection, ned_from_camera, LENS)
    assert anchor.pixel is None
    assert (anchor.height_m, anchor.sigma_m) == pytest.approx((0.85, 0.085))


@pytest.mark.parametrize(
    ("anchor", "height_m", "sigma_m"), [("center", 0.85, 0.1), ("top", 1.7, 0.2), ("ground", 0.0, 0.0)]
)
def test_the_height_of_the_other_anchors(anchor, height_m, sigma_m):
    person = ElevatedTarget(label="person", height_m=1.7, height_sigma_m=0.2, anchor=anchor)
    ned_from_camera, pixels = pole(40.0, 0.0)
    found = anchor_of(person, Detection(1.0, 1.0, box=box_of(pixels)), ned_from_camera, LENS)
    assert (found.height_m, found.sigma_m, found.pixel) == (height_m, sigma_m, None)


@pytest.mark.parametrize("off", [(0.0, 0.0), (0.25, -0.15), (-0.4, 0.3)])
def test_the_centre_of_a_marker_is_not_bent_by_the_lens(off):
    """A square in space; its centre's pixel by the projection, against the crossing of diagonals in the image."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ Rotation.from_euler("z", 0.3).as_matrix()[:2, :2]
    corners = [LENS.pixel_from_camera_point((off[0] + 0.2 * x, off[1] + 0.2 * y, 1.0 + 0.05 * x)) for x, y in square]
    true = LENS.pixel_from_camera_point((off[0], off[1], 1.0))
    a, b, c, d = np.array(corners)
    share = np.linalg.solve(np.array([c - a, b - d]).T, b - a)[0]
    crossing = a + share * (c - a)
    found = marker_centre(Detection(*crossing, corners=tuple(map(tuple, corners))), LENS)
    assert found == pytest.approx(true, abs=1e-6)
    if off != (0.0, 0.0):
        assert np.hypot(*(crossing - true)) > 0.1
    elsewhere = (crossing[0] + 3.0, crossing[1])
    assert marker_centre(Detection(*elsewhere, corners=tuple(map(tuple, corners))), LENS) == elsewhere


@pytest.mark.parametrize("azimuth_deg", [30.0, 150.0, 250.0])
def test_the_foot_of_a_turned_box_is_nearer_to_the_truth_than_that_of_the_upright_one(azimuth_deg):
    """A pole whose image is oblique: its turned box is narrow, the upright one around it has the foot in a corner."""
    ned_from_camera, pixels = pole(55.0, azimuth_deg)
    foot, head = pixels[0], pixels[-1]
    along = (head - foot) / np.linalg.norm(head - foot)
    across = 2.0 * np.array([-along[1], along[0]])
    outline = [foot - across, foot + across, head + across, head - across]
    box = (*np.min(outline, axis=0), *np.max(outline, axis=0))
    upright = foot_pixel(Detection(0.0, 0.0, box=box), ned_from_camera, LENS)
    upright_px = np.hypot(*(np.array(upright) - foot))
    for corners in (outline, outline[::-1]):
        turned = foot_pixel(Detection(0.0, 0.0, box=box, outline=tuple(map(tuple, corners))), ned_from_camera, LENS)
        assert np.hypot(*(np.array(turned) - foot)) < min(0.5, upright_px)


def test_ankles_are_a_little_above_the_ground_and_without_them_the_middle_counts():
    ned_from_camera, pixels = pole(40.0, 0.0)
    person = ElevatedTarget(label="person", height_m=1.7, anchor="ankles")
    ankles = tuple(pixels[1])  # 0.06 m above the ground
    found = anchor_of(person, Detection(1.0, 1.0, box=box_of(pixels), foot=ankles), ned_from_camera, LENS)
    assert found.pixel == ankles
    assert found.height_m == pytest.approx(0.06, abs=0.02)
    assert found.sigma_m < 0.05
    without = anchor_of(person, Detection(1.0, 1.0, box=box_of(pixels)), ned_from_camera, LENS)
    assert (without.pixel, without.height_m) == (None, pytest.approx(0.85))
