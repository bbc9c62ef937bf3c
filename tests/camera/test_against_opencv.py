"""OpenCV as an oracle: for a fisheye inside 80 degrees, for a pinhole anywhere; and where OpenCV itself is wrong."""

from math import cos, degrees, hypot, radians, sin

import cv2
import numpy as np
import pytest

from fwav_companion.camera import BrownConrady, KannalaBrandt
from fwav_companion.camera.batch import camera_rays_from_pixels

FOCAL, CENTRE = (300.0, 301.0), (512.3, 510.2)
FISHEYE_D = (0.02, -0.004, 0.0008, -0.0001)
K = np.array([[FOCAL[0], 0.0, CENTRE[0]], [0.0, FOCAL[1], CENTRE[1]], [0.0, 0.0, 1.0]])
FISHEYE = KannalaBrandt((1.0, *FISHEYE_D), FOCAL, CENTRE, (1200, 1200))


def rays_within(angle: float, count: int = 300) -> np.ndarray:
    rng = np.random.default_rng(3)
    theta, phi = rng.uniform(0.0, angle, count), rng.uniform(-np.pi, np.pi, count)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)


@pytest.mark.parametrize("skew", [0.0, 0.003])
def test_a_fisheye_projects_as_opencv_does_inside_80_degrees(skew):
    rays = rays_within(radians(80.0))
    lens = KannalaBrandt((1.0, *FISHEYE_D), FOCAL, CENTRE, (1200, 1200), skew=skew)

    theirs, _ = cv2.fisheye.projectPoints(rays[None], np.zeros(3), np.zeros(3), K, np.array(FISHEYE_D), alpha=skew)
    ours = [lens.pixel_from_camera_point(tuple(ray)) for ray in rays]

    assert np.abs(theirs[0] - ours).max() < 1e-9


def test_a_fisheyes_pixels_become_the_rays_that_opencv_finds_inside_80_degrees():
    pixels = np.array([FISHEYE.pixel_from_camera_point(tuple(ray)) for ray in rays_within(radians(80.0))])

    until_done = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-14)
    theirs = cv2.fisheye.undistortPoints(pixels[None], K, np.array(FISHEYE_D), criteria=until_done)[0]

    for pixel, (x, y) in zip(pixels, theirs, strict=True):
        expected = np.array([x, y, 1.0]) / np.sqrt(1.0 + x * x + y * y)
        assert FISHEYE.camera_ray_from_pixel(*pixel) == pytest.approx(expected, abs=1e-9)


def test_beyond_90_degrees_opencv_gives_another_place_and_we_do_not():
    """A ray at 100 degrees: OpenCV divides by z, takes the angle for 80 and the other side, and reports no error."""
    ray = (sin(radians(100.0)), 0.0, cos(radians(100.0)))

    theirs, _ = cv2.fisheye.projectPoints(np.array([[ray]]), np.zeros(3), np.zeros(3), K, np.array(FISHEYE_D))
    u, v = FISHEYE.pixel_from_camera_point(ray)
    back = cv2.fisheye.undistortPoints(np.array([[[u, v]]]), K, np.array(FISHEYE_D))[0, 0]

    theta = radians(100.0)
    r = theta * (1 + 0.02 * theta**2 - 0.004 * theta**4 + 0.0008 * theta**6 - 0.0001 * theta**8)
    assert u == pytest.approx(CENTRE[0] + FOCAL[0] * r, abs=1e-9)
    assert theirs[0, 0, 0] < CENTRE[0]
    assert FISHEYE.camera_ray_from_pixel(u, v) == pytest.approx(ray, abs=1e-9)
    their_ray = np.array([*back, 1.0]) / np.hypot(1.0, np.hypot(*back))
    assert np.degrees(np.arccos(np.clip(np.dot(their_ray, ray), -1.0, 1.0))) > 5.0


@pytest.mark.parametrize(
    "distortion",
    [
        (-0.283, 0.0739, 0.00019, 1.76e-05),
        (-0.283, 0.0739, 0.002, -0.001, 0.01),
        (8.1, 2.9, 1e-4, -2e-4, 0.1, 8.4, 5.1, 0.7),
    ],
    ids=["four", "five", "rational"],
)
def test_a_pinhole_projects_as_opencv_does_and_back(distortion):
    lens = BrownConrady(FOCAL, CENTRE, distortion, (1024, 1020))
    rays = rays_within(0.99 * lens.max_angle)

    theirs, _ = cv2.projectPoints(rays[None], np.zeros(3), np.zeros(3), K, np.array(distortion))
    ours = np.array([lens.pixel_from_camera_point(tuple(ray)) for ray in rays])

    assert np.abs(theirs[:, 0] - ours).max() < 1e-9
    back, seen = camera_rays_from_pixels(lens, theirs[:, 0])
    assert seen.all()
    assert np.abs(back - rays).max() < 1e-9


def test_the_papers_frame_ends_where_the_paper_of_its_numbers_says():
    """Half width, half height and corner of 640 x 480 lie at 27.4, 20.6 and 34.3 degrees, not at the 75 of its text."""
    lens = KannalaBrandt((3.55, 0.03, 0.0, 0.0, 0.0), (188.0, 188.0), (320.0, 240.0), (640, 480))

    def angle(u: float, v: float) -> float:
        x, y, z = lens.camera_ray_from_pixel(u, v)
        return degrees(np.arctan2(hypot(x, y), z))

    assert [angle(639.5, 240.0), angle(320.0, 479.5), degrees(lens.max_angle)] == pytest.approx(
        [27.4, 20.6, 34.3], abs=0.07
    )
