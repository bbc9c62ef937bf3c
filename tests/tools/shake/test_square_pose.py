"""The pose of a square by its corners, against poses that were chosen."""

import numpy as np
import pytest
from hands import LENS, fisheye
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.tools.shake.looks import TagView, looks_of
from fwav_companion.tools.shake.square_pose import pose_of_square

PRINT = 0.5 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])


def seen(poses, middles, noise_px=0.0):
    """The views of squares of side 1 at these poses."""
    rng = np.random.default_rng(1)
    views = []
    for pose, middle in zip(poses, middles, strict=True):
        pixels = fisheye(PRINT @ pose.T + middle) + noise_px * rng.normal(size=(4, 2))
        views.append(TagView(BootNs(len(views) * 33_000_000), tuple(map(tuple, pixels.tolist()))))
    return looks_of(views, LENS)


@pytest.fixture
def poses():
    rng = np.random.default_rng(3)
    tilts = Rotation.from_rotvec(rng.uniform(-0.5, 0.5, (60, 3))) * Rotation.from_euler(
        "z", rng.uniform(-3, 3, (60, 1))
    )
    middles = np.stack([rng.uniform(-1, 1, 60), rng.uniform(-0.7, 0.7, 60), rng.uniform(4, 7, 60)], axis=1)
    return tilts.as_matrix(), middles


def test_any_pose_is_recovered_exactly(poses):
    turned, middles = poses
    looks = seen(turned, middles)
    found, places, misfit = pose_of_square(looks.rays, looks.pixel_from_ray)
    assert np.allclose(found, turned, atol=1e-6)
    assert np.allclose(places, middles, atol=1e-5)
    assert misfit.max() < 1e-5


def test_noise_tilts_it_a_little_and_never_to_the_other_side(poses):
    turned, middles = poses
    looks = seen(turned, middles, noise_px=0.15)
    found, _, misfit = pose_of_square(looks.rays, looks.pixel_from_ray)
    off = np.degrees(Rotation.from_matrix(found @ np.swapaxes(turned, 1, 2)).magnitude())
    assert np.median(off) < 1.5
    assert off.max() < 8.0
    assert misfit.mean() == pytest.approx(0.15 * np.sqrt(2 / 8), rel=0.4)


def test_frames_whose_corners_the_lens_does_not_see_are_left_out(poses):
    turned, middles = poses
    outside = middles.copy()
    outside[:10, 0] = 40.0
    assert len(seen(turned, outside)) == 50


def test_corners_told_the_other_way_round_are_put_in_order(poses):
    turned, middles = poses
    looks = seen(turned @ np.diag([1.0, -1.0, -1.0]), middles)  # a print seen from its back runs the other way
    assert looks.backward
    assert not seen(turned, middles).backward


def test_rows_read_one_after_another_are_put_at_one_instant():
    """A square that moves evenly through the image, with a readout: as if the shutter were global."""
    pose, speed, readout_s = np.eye(3), np.array([0.6, 0.3, 0.0]), 0.02
    views = []
    for frame in range(12):
        rows = np.full(4, 240.0)
        for _ in range(8):
            t = frame / 30.0 + readout_s * rows / 480.0
            pixels = fisheye(PRINT @ pose.T + np.array([-0.1, 0.0, 5.0]) + t[:, None] * speed)
            rows = pixels[:, 1]
        views.append(TagView(BootNs(round(frame / 30.0 * 1e9)), tuple(map(tuple, pixels.tolist()))))
    looks = looks_of(views, LENS)
    bent, _, _ = pose_of_square(looks.rays, looks.pixel_from_ray)
    steady, _, misfit = pose_of_square(looks.at_once(readout_s), looks.pixel_from_ray)
    assert np.degrees(Rotation.from_matrix(bent).magnitude()).max() > 0.3
    assert np.degrees(Rotation.from_matrix(steady).magnitude())[1:-1].max() < 0.05
    assert misfit.max() < 0.02
