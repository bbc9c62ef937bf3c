"""Top view of the ground: soil, grass and stones at several scales, with the tags on it.

Only this module and :mod:`sitl_mock.render` need numpy and cv2.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from sitl_mock.tags import WITH_MARGIN, GroundTag

Picture = NDArray[np.uint8]

HALF_M = 40.0
"""Half side of the picture, metres; beyond it there is haze."""
TEXEL_M = 0.02
"""Side of a texel, metres: about the width of a camera pixel on the ground from 12 m."""
HAZE = 118
FADE_M = 8.0
"""Width of the border in which the ground fades into the haze, metres."""
SCALES_M = ((11.0, 14.0), (3.7, 13.0), (1.3, 12.0), (0.45, 13.0), (0.15, 13.0), (0.06, 10.0))
"""(patch size in metres, contrast in grey levels); no size is a multiple of another."""
STONES = 2600
OVERSAMPLED = 8
"""Subsamples per texel and axis, when a tag is drawn."""
BLACK, WHITE = 25, 225
"""Grey levels of printed paper in daylight."""


class Ground:
    """Grey levels of the ground by (north, east)."""

    def __init__(self, centre: tuple[float, float], tags: Sequence[GroundTag], seed: int) -> None:
        self.centre = centre
        self.picture = _soil(np.random.default_rng(seed))
        for tag in tags:
            self._lay(tag)

    @property
    def size(self) -> int:
        """Texels per side."""
        return int(self.picture.shape[0])

    def texel(self, north: NDArray[np.float64], east: NDArray[np.float64]) -> tuple[NDArray[np.float32], ...]:
        """(x, y) in the picture of places on the ground: x east, y south, (0, 0) the centre of the first texel."""
        middle = (self.size - 1) / 2.0
        x = (east - self.centre[1]) / TEXEL_M + middle
        y = middle - (north - self.centre[0]) / TEXEL_M
        return x.astype(np.float32), y.astype(np.float32)

    def _lay(self, tag: GroundTag) -> None:
        """Draws a tag; each texel is the mean of many points."""
        corners = [tag.point(*at) for at in ((-1.25, -1.25), (1.25, -1.25), (1.25, 1.25), (-1.25, 1.25))]
        x, y = self.texel(np.array([n for n, _ in corners]), np.array([e for _, e in corners]))
        left, top = int(x.min()) - 1, int(y.min()) - 1
        width, height = int(x.max()) + 3 - left, int(y.max()) + 3 - top
        if left < 0 or top < 0 or left + width > self.size or top + height > self.size:
            return
        # Maps the board's picture (one texel per module) onto the ground: three corners determine the affine map.
        fine_x = (x - left + 0.5) * OVERSAMPLED - 0.5
        fine_y = (y - top + 0.5) * OVERSAMPLED - 0.5
        there = np.stack([fine_x, fine_y], axis=1)[:3].astype(np.float32)
        edge = WITH_MARGIN - 0.5
        here = np.array([(-0.5, -0.5), (edge, -0.5), (edge, edge)], np.float32)
        board = board_picture(tag.tag_id)
        matrix = cv2.getAffineTransform(here, there)
        fine_size = (width * OVERSAMPLED, height * OVERSAMPLED)
        sharp = cv2.warpAffine(board, matrix, fine_size, flags=cv2.INTER_NEAREST)
        inside = cv2.warpAffine(np.full_like(board, 255), matrix, fine_size, flags=cv2.INTER_NEAREST)
        drawn = cv2.resize(sharp.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
        share = cv2.resize(inside.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA) / 255.0
        patch = self.picture[top : top + height, left : left + width]
        patch[:] = np.clip(drawn + (1.0 - share) * patch + 0.5, 0, 255).astype(np.uint8)


def board_picture(tag_id: int) -> Picture:
    """Picture of a tag's board, (10, 10): one pixel per module, the white margin included."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    modules = cv2.aruco.generateImageMarker(dictionary, tag_id, WITH_MARGIN - 2)
    printed = np.where(modules > 127, WHITE, BLACK).astype(np.uint8)
    return np.pad(printed, 1, constant_values=WHITE)


def _soil(rng: np.random.Generator) -> Picture:
    size = int(2 * HALF_M / TEXEL_M)
    soil = np.full((size, size), float(HAZE), np.float32)
    for patch_m, levels in SCALES_M:
        nodes = max(4, int(2 * HALF_M / patch_m))
        grid = rng.standard_normal((nodes, nodes)).astype(np.float32)
        soil += levels * cv2.resize(grid, (size, size), interpolation=cv2.INTER_CUBIC)
    _strew(soil, rng)
    across = np.abs(np.linspace(-HALF_M, HALF_M, size, dtype=np.float32))
    near = np.clip((HALF_M - across) / FADE_M, 0.0, 1.0)
    share = np.minimum.outer(near, near)
    return np.clip(HAZE + share * (soil - HAZE), 0, 255).astype(np.uint8)


def _strew(soil: NDArray[np.float32], rng: np.random.Generator) -> None:
    """Adds stones and tufts: structures of real ground that noise does not have."""
    size = soil.shape[0]
    places = rng.uniform(0, size, (STONES, 2)).astype(int)
    radii = rng.gamma(1.6, 0.05 / TEXEL_M, STONES)
    shades = rng.normal(HAZE, 45.0, STONES)
    for (x, y), radius, shade, turn in zip(places, radii, shades, rng.uniform(0, 180, STONES), strict=True):
        axes = (max(1, int(radius)), max(1, int(radius * 0.6)))
        cv2.ellipse(soil, (int(x), int(y)), axes, float(turn), 0, 360, float(shade), -1, cv2.LINE_AA)
