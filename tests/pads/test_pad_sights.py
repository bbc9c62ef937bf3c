"""One sighting of a pad's landing point from the sightings of its tags, and what is left out."""

from __future__ import annotations

from math import degrees

import msgspec
import numpy as np
import pytest
from seen_pads import LENS, THREE, Scene

from fwav_companion.geometry.vectors import transform
from fwav_companion.pads.pad_sights import PadSights
from fwav_companion.types import ElevatedTarget, Pad, PadTag, Reason

BESIDE = msgspec.structs.replace(THREE, landing_offset_m=(-1.5, 2.0), height_m=0.3)


def joined(scene, sightings, sights=None):
    return (sights or PadSights([scene.pad], [], LENS)).joined(sightings)


def toward(sighting):
    """Unit vector to what a sighting shows, NED."""
    return np.array(transform(sighting.ned_from_camera, sighting.ray.direction))


def angle_deg(a, b):
    return degrees(np.arccos(min(1.0, float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b)))))


def test_tags_of_a_pad_are_one_sighting_of_the_landing_point():
    scene = Scene(BESIDE)
    (seen,), refused = joined(scene, scene.sightings())
    assert seen.detection.label == "pad"
    assert seen.index == 0  # that of the largest tag
    assert angle_deg(toward(seen), scene.place(-1.5, 2.0)) < 1e-3
    assert seen.size_height.height_m == pytest.approx(3.0, abs=1e-4)
    assert (seen.anchor_height_m, seen.anchor_sigma_m) == pytest.approx((0.3, 0.03))
    assert refused == [(1, Reason.PART_OF_PAD, None), (2, Reason.PART_OF_PAD, None)]


def test_other_sightings_stay_as_they_are():
    scene = Scene(THREE)
    person = msgspec.structs.replace(
        scene.sighting(0), index=1, detection=msgspec.structs.replace(scene.sighting(0).detection, label="person")
    )
    tag = msgspec.structs.replace(scene.sighting(0), index=2)
    kept, _ = joined(scene, [person, tag])
    assert [each.detection.label for each in kept] == ["person", "pad"]
    assert kept[0] is person


def test_heading_error_is_in_the_sigma_of_an_offset_point():
    """2 m beside one tag of 0.2 m at 5 m, corners of 0.6 px: heading to 1.6 deg, 6 cm of the landing point."""
    near, far = [
        Pad(label="pad", tags=(PadTag(label="a", size_m=0.2),), landing_offset_m=offset)
        for offset in ((0.0, 0.0), (0.0, 2.0))
    ]
    noise, errors, claims = np.random.default_rng(4), [], []
    for pad in (near, far):
        scene = Scene(pad, camera=(0.0, 0.0, -5.0), euler=(0.0, 0.0, 0.0), heading=0.0)
        across, sigma = [], []
        for _ in range(120):
            (seen,), _ = joined(scene, scene.sightings(noise=noise, sigma=0.3))
            true = scene.place(*pad.landing_offset_m)
            ray = toward(seen)
            across.append(ray[0] / ray[2] * 5.0 - true[0])  # north: across the offset
            axes = np.array([transform(seen.ned_from_camera, each) for each in (seen.ray.d_du, seen.ray.d_dv)])
            cov = axes.T @ np.diag(np.square(seen.pixel_sigma)) @ axes
            sigma.append(np.sqrt(cov[0, 0]) * np.linalg.norm(true))
        errors.append(np.std(across))
        claims.append(np.mean(sigma))
    assert errors[1] > 5.0 * errors[0]
    assert claims == pytest.approx(errors, rel=0.3)


def test_small_tags_take_over_without_a_jump():
    """The landing point by all tags, by the two small ones, and by the smallest alone."""
    scene, sights = Scene(BESIDE, camera=(-0.2, 0.0, -0.9)), PadSights([BESIDE], [], LENS)
    seen = [joined(scene, scene.sightings(numbers), sights)[0][0] for numbers in ((0, 1, 2), (1, 2), (2,))]
    for each in seen:
        assert angle_deg(toward(each), scene.place(-1.5, 2.0)) < 0.01
        assert each.detection.label == "pad"


def test_cut_off_tag_counts_as_far_as_it_is_seen():
    """The large tag hangs over the image's edge with two corners: they still improve the heading."""
    scene = Scene(BESIDE, camera=(-0.2, -0.1, -0.6), euler=(0.0, 0.0, 0.0), heading=0.0)
    outside = [not (-0.5 <= u < 639.5 and -0.5 <= v < 479.5) for u, v in scene.corners(BESIDE.tags[0])]
    assert sum(outside) == 2
    (cut,), _ = joined(scene, scene.sightings([0, 2]))
    (alone,), _ = joined(scene, scene.sightings([2]))
    assert angle_deg(toward(cut), scene.place(-1.5, 2.0)) < 0.01
    assert max(cut.pixel_sigma) < 0.5 * max(alone.pixel_sigma)


@pytest.mark.parametrize("order", [(1, 2, 3, 0), (2, 3, 0, 1), (0, 3, 2, 1), (3, 2, 1, 0), (0, 1, 3, 2)])
def test_corners_in_another_order_give_the_same_pose(order):
    """What two tags have shown of a detector's order holds for one tag, too."""
    scene, sights = Scene(BESIDE), PadSights([BESIDE], [], LENS)
    for numbers in ((0, 1, 2), (0,)):
        (seen,), _ = joined(scene, scene.sightings(numbers, order=order), sights)
        assert angle_deg(toward(seen), scene.place(-1.5, 2.0)) < 0.01


def test_tag_that_lies_elsewhere_is_named_and_left_out():
    scene = Scene(THREE)
    real = msgspec.structs.replace(THREE.tags[2], at_m=(-0.3 + 0.21, -0.1))
    moved = [scene.sighting(0, index=0), scene.sighting(1, index=1), scene.sighting(2, index=2, tag=real)]
    sights = PadSights([THREE], [], LENS)
    (seen,), refused = joined(scene, moved, sights)
    assert (2, Reason.CONTRADICTS_PAD, None) in refused
    (found,) = sights.contradictions
    assert (found.pad, found.tag, found.pictures) == ("pad", "tag36h11:2", 1)
    assert found.off_m == pytest.approx(0.21, abs=0.003)
    assert angle_deg(toward(seen), scene.place(0.0, 0.0)) < 0.01


def test_tag_that_a_lens_displaces_by_five_pixels_does_not_contradict():
    """4 cm at 5 m: beyond four sigmas of its corners, and within what lenses err."""
    scene = Scene(THREE, camera=(0.0, 0.0, -5.0))
    real = msgspec.structs.replace(THREE.tags[2], at_m=(-0.26, -0.1))
    sightings = [scene.sighting(0, index=0), scene.sighting(1, index=1), scene.sighting(2, index=2, tag=real)]
    sights = PadSights([THREE], [], LENS)
    joined(scene, sightings, sights)
    assert sights.contradictions == []


def test_of_two_copies_the_one_on_the_pad_counts():
    """The larger one is a picture of the tag on a screen, a metre aside."""
    scene = Scene(THREE)
    screen = msgspec.structs.replace(THREE.tags[1], at_m=(0.35, 1.1), size_m=0.3)
    sightings = [scene.sighting(0, index=0), scene.sighting(1, index=1, tag=screen), scene.sighting(1, index=2)]
    (seen,), refused = joined(scene, sightings)
    assert (1, Reason.TAG_COPY, None) in refused
    assert angle_deg(toward(seen), scene.place(0.0, 0.0)) < 0.01


def test_of_two_copies_alone_the_one_at_the_last_place_counts():
    scene, sights = Scene(THREE), PadSights([THREE], [], LENS)
    joined(scene, scene.sightings([1]), sights)
    screen = msgspec.structs.replace(THREE.tags[1], at_m=(0.35, 1.1), size_m=0.3)
    both = [scene.sighting(1, index=0, tag=screen, at=1.1), scene.sighting(1, index=1, at=1.1)]
    (seen,), refused = joined(scene, both, sights)
    assert refused == [(0, Reason.TAG_COPY, None)]
    assert angle_deg(toward(seen), scene.place(0.0, 0.0)) < 0.01


def test_tag_without_corners_is_the_pad_where_it_is_the_landing_point():
    scene = Scene(THREE)
    (seen,), _ = joined(scene, scene.sightings([0], corners=False))
    assert seen.detection.label == "pad"
    assert seen.size_height is None
    none, refused = joined(Scene(BESIDE), Scene(BESIDE).sightings([0], corners=False))
    assert (none, refused) == ((), [(0, Reason.NO_PAD_POSE, None)])


def test_size_of_a_single_tag_says_the_height():
    """0.2 m at 5 m, focal length 667 px, corners of 0.3 px: 3 cm."""
    alone = Pad(label="a", tags=(PadTag(label="a", size_m=0.2),))
    scene, noise = Scene(alone, camera=(1.0, 0.5, -5.0)), np.random.default_rng(8)
    sized, heights, sigmas = PadSights([], [ElevatedTarget(label="a", size_m=0.2)], LENS), [], []
    for _ in range(80):
        (seen,), refused = joined(scene, scene.sightings(noise=noise, sigma=0.15), sized)
        assert seen.detection.label == "a"
        assert seen.ray == scene.sighting(0).ray
        assert not refused
        heights.append(seen.size_height.height_m)
        sigmas.append(seen.size_height.noise_m)
    assert np.mean(heights) == pytest.approx(5.0, abs=0.02)
    assert 0.02 < np.std(heights) < np.mean(sigmas) < 0.08


def test_rows_at_different_instants_are_put_together():
    """The vehicle rolled by a degree between the rows of two tags."""
    scene, later = (
        Scene(BESIDE, euler=(2.0, -3.0, 25.0)),
        Scene(BESIDE, camera=(0.31, -0.2, -3.0), euler=(3.0, -3.0, 25.0)),
    )
    (seen,), refused = joined(scene, [scene.sighting(0, index=0), later.sighting(1, index=1)])
    assert refused == [(1, Reason.PART_OF_PAD, None)]
    assert angle_deg(toward(seen), scene.place(-1.5, 2.0)) < 0.01


def test_pad_is_looked_for_where_its_tags_are_not_where_its_landing_point_is():
    """The landing point is 2.5 m off the tags: a frame that shows it alone is no missed detection."""
    scene, sights = Scene(BESIDE), PadSights([BESIDE], [], LENS)
    landing_point = tuple(map(float, scene.place(-1.5, 2.0) + scene.camera))

    def north_of(limit):
        return sights.could_see(lambda place: place[0] > limit)

    assert north_of(-100.0)(landing_point)  # before the first picture a place counts as itself
    joined(scene, scene.sightings(), sights)
    tags = [scene.ned_from_pad @ [*corner, 0.0] for tag in BESIDE.tags for corner in [tag.at_m]]
    lowest, highest = min(tag[0] for tag in tags), max(tag[0] for tag in tags)
    assert landing_point[0] < lowest - 0.5
    assert north_of(lowest - 0.4)(landing_point)
    assert not north_of(highest + 0.4)(landing_point)
    assert not north_of(lowest - 0.4)((landing_point[0] - 5.0, *landing_point[1:]))
