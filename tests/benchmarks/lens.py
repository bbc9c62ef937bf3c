"""Pixels to unit rays, one and a million, against cv2.fisheye.undistortPoints.

``python -m tests.benchmarks.lens``
"""

from __future__ import annotations

import cv2
import numpy as np

from fwav_companion.camera import KannalaBrandt
from fwav_companion.camera.batch import camera_rays_from_pixels
from tests.benchmarks.figure import Figure, interleaved

PAPER = KannalaBrandt((3.55, 0.03, 0.0, 0.0, 0.0), (188.0, 188.0), (320.0, 240.0), (640, 480))
K = np.array([[188.0 * 3.55, 0.0, 320.0], [0.0, 188.0 * 3.55, 240.0], [0.0, 0.0, 1.0]])
D = np.array([0.03 / 3.55, 0.0, 0.0, 0.0])
CALLS = 20_000


def one_ray() -> Figure:
    """Time of one pixel, given in the form that each side needs: an array for cv2, two numbers for us."""
    pixel = np.array([[[136.4, 412.8]]])

    def theirs() -> None:
        for _ in range(CALLS):
            cv2.fisheye.undistortPoints(pixel, K, D)

    def ours() -> None:
        for _ in range(CALLS):
            PAPER.camera_ray_from_pixel(136.4, 412.8)

    cv2_s, ours_s = interleaved(theirs, ours)
    detail = f"cv2 {cv2_s / CALLS * 1e6:.2f} us, ours {ours_s / CALLS * 1e6:.2f} us"
    return Figure("pixel to ray, one", cv2_s / ours_s, 2.5, True, detail)


def a_million_rays() -> Figure:
    pixels = np.random.default_rng(1).uniform((0.0, 0.0), (639.0, 479.0), (1_000_000, 2))
    cv2_s, ours_s = interleaved(
        lambda: cv2.fisheye.undistortPoints(pixels[None], K, D), lambda: camera_rays_from_pixels(PAPER, pixels)
    )
    detail = f"cv2 {cv2_s * 1e3:.1f} ms, ours {ours_s * 1e3:.1f} ms"
    return Figure("pixel to ray, a million", cv2_s / ours_s, 1.5, True, detail)


def measure() -> list[Figure]:
    return [one_ray(), a_million_rays()]


if __name__ == "__main__":
    for figure in measure():
        print(figure)
