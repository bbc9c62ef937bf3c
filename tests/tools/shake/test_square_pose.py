"""The pose of a square by its corners, against poses that were chosen."""

import numpy as np
import pytest
from hands import LENS, fisheye
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.tools.shake.observations import TagObservation, observations_from_tags, square_poses

PRINT = 0.5 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])


def seen(poses, middles, noise_px=0.0):
    """The views of squares of side 1 at these poses."""
    rng = np.random.default_rng(1)
    views = []
    for pose, middle in zip(poses, middles, strict=True):
        pixels = fisheye(PRINT @ pose.T + middle) + noise_px * rng.normal(size=(4, 2))
        views.append(TagObservation(BootNs(len(views) * 33_000_000), tuple(map(tuple, pixels.tolist()))))
    return observations_from_tags(views, LENS)


@pytest.fixture
def poses():
    rng = np.random.default_rng(3)
    tilts = Rotation.from_rotvec(rng.uniform(-0.5, 0.5, (60, 3))) * Rotation.from_euler(
        "z", rng.uniform(-3, 3, (60, 1))
    )
    middles = np.stack([rng.uniform(-1, 1, 60), rng.uniform(-0.7, 0.7, 60), rng.uniform(4, 7, 60)], axis=1)
    return tilts.as_matrix(), middles


def misfit_px(rays, found, places):
    """(N,) RMS of the corners' reprojection errors in pixels, by the fisheye's formula."""
    modelled = fisheye(PRINT @ np.swapaxes(found.as_matrix(), 1, 2) + places[:, None, :])
    return np.sqrt(((modelled - fisheye(rays)) ** 2).mean(axis=(1, 2)))


def test_any_pose_is_recovered_exactly(poses):
    turned, middles = poses
    tags = seen(turned, middles)
    found, places = square_poses(tags.rays)
    assert np.allclose(found.as_matrix(), turned, atol=1e-6)
    assert np.allclose(places, middles, atol=1e-5)
    assert misfit_px(tags.rays, found, places).max() < 1e-5


def test_noise_tilts_it_a_little_and_never_to_the_other_side(poses):
    turned, middles = poses
    tags = seen(turned, middles, noise_px=0.15)
    found, places = square_poses(tags.rays)
    off = np.degrees((found * Rotation.from_matrix(turned).inv()).magnitude())
    assert np.median(off) < 1.5
    assert off.max() < 8.0
    assert misfit_px(tags.rays, found, places).mean() == pytest.approx(0.15 * np.sqrt(2 / 8), rel=0.4)


def test_frames_whose_corners_the_lens_does_not_see_are_left_out(poses):
    turned, middles = poses
    outside = middles.copy()
    outside[:10, 0] = 40.0
    assert len(seen(turned, outside)) == 50


def test_corners_sent_the_other_way_round_are_put_in_order(poses):
    turned, middles = poses
    tags = seen(turned @ np.diag([1.0, -1.0, -1.0]), middles)  # a print seen from its back runs the other way
    assert tags.backward
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
        views.append(TagObservation(BootNs(round(frame / 30.0 * 1e9)), tuple(map(tuple, pixels.tolist()))))
    tags = observations_from_tags(views, LENS)
    bent, _ = square_poses(tags.rays)
    at_once = tags.global_shutter_rays(readout_s)
    steady, places = square_poses(at_once)
    assert np.degrees(bent.magnitude()).max() > 0.3
    assert np.degrees(steady.magnitude())[1:-1].max() < 0.05
    assert misfit_px(at_once, steady, places).max() < 0.02
