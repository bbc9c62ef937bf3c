"""Rendered pictures of one target with known truth: lens blur, motion blur, sensor noise, any place between pixels."""

from dataclasses import dataclass

import cv2
import numpy as np

FINE = 4
"""Fine pixels of a pixel, along each side."""
NOISE_LEVELS, LENS_BLUR_PX = 2.5, 0.6
"""Sensor noise, grey levels of 255, and blur of the lens, one sigma: those of the mock's camera."""
GRASS_LEVELS = 20.0
"""Unevenness of the ground about a target, over four pixels, grey levels."""


@dataclass
class Scene:
    """One target in a picture that is little larger than itself."""

    picture: np.ndarray
    centre: tuple[float, float]


def rendered(flat, corners, rng, *, blur_px, ground=110):
    """A flat picture whose outer corners (4, 2) lie at these pixels, moved by ``blur_px`` in any direction."""
    lower, upper = corners.min(axis=0) - blur_px - 12.0, corners.max(axis=0) + blur_px + 12.0
    size = tuple(int(n) for n in np.ceil(upper - lower))
    shift = np.floor(lower)
    height, width = flat.shape[:2]
    outer = np.float32([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]])
    fine_corners = np.float32((corners - shift + 0.5) * FINE - 0.5)
    matrix = cv2.getPerspectiveTransform(outer, fine_corners)
    fine_size = (size[0] * FINE, size[1] * FINE)
    fine = cv2.warpPerspective(flat, matrix, fine_size, flags=cv2.INTER_NEAREST)
    inside = cv2.warpPerspective(np.full((height, width), 255, np.uint8), matrix, fine_size, flags=cv2.INTER_NEAREST)
    coarse = rng.normal(0.0, GRASS_LEVELS, (size[1] // 4 + 2, size[0] // 4 + 2)).astype(np.float32)
    behind = np.clip(ground + cv2.resize(coarse, fine_size, interpolation=cv2.INTER_LINEAR), 0, 255)
    if flat.ndim == 3:
        behind = np.repeat(behind[:, :, None], 3, axis=2)
        inside = inside[:, :, None]
    light = np.where(inside > 0, fine, behind).astype(np.float32)
    light = moved(light, rng.uniform(0.0, np.pi), blur_px * FINE)
    light = cv2.GaussianBlur(light, (0, 0), LENS_BLUR_PX * FINE)
    light = cv2.resize(light, size, interpolation=cv2.INTER_AREA)
    light += rng.normal(0.0, NOISE_LEVELS, light.shape)
    return np.clip(np.round(light), 0, 255).astype(np.uint8), shift


def moved(light, direction, length):
    """The mean over a straight motion of this length, centred on where it is."""
    if length < 1.0:
        return light
    reach = int(np.ceil(length / 2.0)) + 1
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
    for share in np.linspace(-0.5, 0.5, 8 * reach):
        x, y = reach + share * length * np.cos(direction), reach + share * length * np.sin(direction)
        i, j = int(y), int(x)
        for di, dj in ((0, 0), (0, 1), (1, 0), (1, 1)):
            kernel[i + di, j + dj] += abs(1 - di - (y - i)) * abs(1 - dj - (x - j))
    return cv2.filter2D(light, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)


def square_corners(rng, side_px, tilt=0.25):
    """(centre, corners) of a square seen from somewhere: turned, foreshortened, anywhere between pixels."""
    turn, lean = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 2.0 * np.pi)
    c, s = np.cos(turn), np.sin(turn)
    axis = np.array([np.cos(lean), np.sin(lean)])
    plane = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ np.array([[c, s], [-s, c]])
    depth = 1.0 + rng.uniform(0.0, tilt) * (plane @ axis)[:, None]
    centre = rng.uniform(0.0, 1.0, 2)
    return centre, centre + 0.5 * side_px * plane / depth


def marker_scene(rng, side_px, *, dictionary, modules, blur_px=0.0):
    """A marker whose black square has this side, with a white margin of one module."""
    number = int(rng.integers(0, 30))
    marker = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(dictionary), number, modules)
    flat = cv2.resize(np.pad(marker, 1, constant_values=225), None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST)
    flat = np.maximum(flat, 20)
    centre, corners = square_corners(rng, side_px * (modules + 2) / modules)
    picture, shift = rendered(flat, corners, rng, blur_px=blur_px)
    return Scene(picture, tuple(centre - shift))


def blob_scene(rng, side_px, *, blur_px=0.0):
    """A red panel on grey ground. Its truth is the mean of its own area."""
    red = rng.uniform(140.0, 230.0)
    flat = np.zeros((64, 64, 3), np.uint8)
    flat[:] = (red * rng.uniform(0.1, 0.3), red * rng.uniform(0.1, 0.3), red)
    centre, corners = square_corners(rng, side_px, tilt=0.0)
    picture, shift = rendered(flat, corners, rng, blur_px=blur_px, ground=rng.uniform(80.0, 140.0))
    return Scene(picture, tuple(centre - shift))
