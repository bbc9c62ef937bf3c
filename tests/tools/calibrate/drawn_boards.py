"""Boards as a fisheye sees them, by independent mathematics: the truth for the tests of `calibrate`.

Nothing of the project is used here. A lens is r = c1 t + c2 t^3 + ... in pixels; its inverse is read off a fine table.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np


@dataclass(frozen=True)
class TrueLens:
    """``c`` in pixels along u; v is stretched by ``aspect``; pixel (0, 0) is the centre of the first."""

    c: tuple[float, ...]
    centre: tuple[float, float]
    size: tuple[int, int]
    aspect: float = 1.0
    sees: float = np.pi

    def radius(self, theta):
        return sum(c * theta ** (2 * i + 1) for i, c in enumerate(self.c))

    def pixels(self, points):
        """(..., 2) of (..., 3) points in the camera frame."""
        x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
        theta, phi = np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
        r = self.radius(theta)
        return np.stack([self.centre[0] + r * np.cos(phi), self.centre[1] + self.aspect * r * np.sin(phi)], axis=-1)

    def rays(self, pixels):
        """(..., 3) unit rays; NaN beyond what the lens sees."""
        x, y = pixels[..., 0] - self.centre[0], (pixels[..., 1] - self.centre[1]) / self.aspect
        angles = np.linspace(0.0, self.sees, 20000)
        theta = np.interp(np.hypot(x, y), self.radius(angles), angles, right=np.nan)
        phi = np.arctan2(y, x)
        return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


PAPER = TrueLens((667.4, 5.64), (320.0, 240.0), (640, 480))
NARROW = TrueLens((1500.0, 500.0, 200.0), (325.0, 236.0), (640, 480), aspect=1.002)  # f tan(t): a pinhole's
WIDE = TrueLens((190.0, -6.0, 1.5, -0.9), (322.3, 236.9), (640, 480), aspect=0.999, sees=1.75)  # 200 degrees


def turn(axis, angle):
    """(3, 3) rotation about an axis, by Rodrigues."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def chess_points(columns, rows, square_m):
    """(N, 3) inner corners, row by row, about the board's middle."""
    x, y = np.meshgrid(np.arange(columns) - (columns - 1) / 2, np.arange(rows) - (rows - 1) / 2)
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1) * square_m


def chess_grey(columns, rows, square_m):
    """Grey levels 0..1 of the board's plane as a function; NaN off the sheet."""

    def grey(x, y):
        i, j = np.floor(x / square_m + (columns + 1) / 2), np.floor(y / square_m + (rows + 1) / 2)
        inside = (i >= 0) & (i <= columns) & (j >= 0) & (j <= rows)
        sheet = (i >= -1) & (i <= columns + 1) & (j >= -1) & (j <= rows + 1)
        return np.where(inside, np.where((i + j) % 2 == 0, 0.08, 0.9), np.where(sheet, 0.9, np.nan))

    return grey


def printed_grey(image, width_m):
    """Grey levels of a printed picture as a function: ``width_m`` wide, about its middle."""
    rows, columns = image.shape
    per_m = columns / width_m

    def grey(x, y):
        i, j = np.floor(x * per_m + columns / 2), np.floor(y * per_m + rows / 2)
        on = (i >= 0) & (i < columns) & (j >= 0) & (j < rows)
        taken = image[
            np.clip(np.nan_to_num(j), 0, rows - 1).astype(int), np.clip(np.nan_to_num(i), 0, columns - 1).astype(int)
        ]
        return np.where(on, 0.08 + 0.82 * taken / 255.0, np.nan)

    return grey


def poses(rng, count, width_m, *, reach, tilt=0.6, share=0.45):
    """Boards all over the lens: (rotation, translation) with the middle at angles up to ``reach``.

    Each is seen nearly face on, turned by up to ``tilt``, at such a distance that it is ``share`` of a radian wide.
    """
    made = []
    for i in range(count):
        off = reach * np.sqrt((i + 0.5) / count)
        phi = 2.399963 * i + rng.uniform(-0.2, 0.2)
        axis = np.array([-np.sin(phi), np.cos(phi), 0.0])
        towards = turn(axis, off)
        tilted = turn([np.cos(3.1 * i), np.sin(3.1 * i), 0.0], tilt * rng.uniform(0.4, 1.0))
        rotation = towards @ tilted @ turn([0, 0, 1], rng.uniform(-0.6, 0.6))
        distance = width_m / share * rng.uniform(0.8, 1.3)
        made.append((rotation, towards @ np.array([0.0, 0.0, distance])))
    return made


def half_size(lens):
    """The same lens over half as many pixels a side: quicker to draw."""
    u, v = ((centre + 0.5) / 2 - 0.5 for centre in lens.centre)
    return TrueLens(
        tuple(c / 2 for c in lens.c), (u, v), (lens.size[0] // 2, lens.size[1] // 2), lens.aspect, lens.sees
    )


@lru_cache(maxsize=4)
def sample_rays(lens, samples):
    """(samples^2, height, width, 3): each pixel's, evenly over its area."""
    width, height = lens.size
    v, u = np.mgrid[0:height, 0:width].astype(float)
    offsets = (np.arange(samples) + 0.5) / samples - 0.5
    return np.stack([lens.rays(np.stack([u + du, v + dv], axis=-1)) for dv in offsets for du in offsets])


def picture(lens, pose, grey, rng, *, noise=2.0, samples=2):
    """(height, width) uint8: the board before a dull background, each pixel the mean of samples^2."""
    rotation, middle = pose
    width, height = lens.size
    v, u = np.mgrid[0:height, 0:width].astype(float)
    dull = 0.35 + 0.1 * np.sin(u / 37.0) * np.cos(v / 29.0)
    total = np.zeros((height, width))
    for rays in sample_rays(lens, samples):
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (middle @ rotation[:, 2]) / (rays @ rotation[:, 2])
            hit = rays * far[..., None] - middle
            seen = grey(hit @ rotation[:, 0], hit @ rotation[:, 1])
            total += np.where((far > 0.0) & np.isfinite(seen), seen, dull)
    grain = rng.normal(0.0, noise, (height, width))
    return np.clip(255.0 * total / samples**2 + grain, 0, 255).astype(np.uint8)


def views(lens, rng, count, *, reach, share, noise=0.1, board=(7, 5, 0.03)):
    """Corners alone, without pictures: (name, (N, 2) board, (N, 2) pixels), of what lies inside the image."""
    points, made = chess_points(*board), []
    for i, (rotation, middle) in enumerate(poses(rng, count, board[0] * board[2], reach=reach, share=share)):
        seen = points @ rotation.T + middle
        theta = np.arctan2(np.hypot(seen[:, 0], seen[:, 1]), seen[:, 2])
        pixels = lens.pixels(seen)
        inside = ((pixels > -0.5) & (pixels < np.array(lens.size) - 0.5)).all(axis=1) & (theta < lens.sees)
        if inside.sum() >= 8:
            made.append(
                (f"{i:02d}.png", points[inside, :2], pixels[inside] + rng.normal(0.0, noise, (inside.sum(), 2)))
            )
    return made


def charuco_sheet(legacy=False, down=5, across=7, dictionary=cv2.aruco.DICT_4X4_50):
    """A ChArUco board as printed: 60 pixels a square, with a white border of half a square."""
    size = (across, down)
    drawn = cv2.aruco.CharucoBoard(size, 0.03, 0.022, cv2.aruco.getPredefinedDictionary(dictionary))
    drawn.setLegacyPattern(legacy)
    return np.pad(drawn.generateImage((across * 60, down * 60)), 30, constant_values=255)


def aprilgrid_sheet(across, down, side, gap, *, up, turned, family=cv2.aruco.DICT_APRILTAG_36h11):
    """Tags with squares between their corners; rows counted upwards as Kalibr does, or downwards; each tag turned."""
    dictionary, step = cv2.aruco.getPredefinedDictionary(family), side + gap
    sheet = np.full((down * step + gap, across * step + gap), 255, np.uint8)
    for number in range(across * down):
        row, column = divmod(number, across)
        top, left = gap + (down - 1 - row if up else row) * step, gap + column * step
        tag = cv2.aruco.generateImageMarker(dictionary, number, side)
        sheet[top : top + side, left : left + side] = np.rot90(tag, turned)
    for row in range(down + 1):
        for column in range(across + 1):
            sheet[row * step : row * step + gap, column * step : column * step + gap] = 0
    return np.pad(sheet, gap, constant_values=255)
