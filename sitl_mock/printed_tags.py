"""Tags of pads in a picture, each in the resolution that the picture shows: the ground's texels are too coarse."""

from __future__ import annotations

from functools import lru_cache
from math import ceil, cos, radians, sin, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from sitl_mock.ground_picture import Picture, board_picture
from sitl_mock.picture_grid import STEP, to_pixels
from sitl_mock.tags import MODULES, WITH_MARGIN, PadTag

Array = NDArray[np.float64]

MOST_TEXELS = 100
"""Most texels along a module's side: modules of more pixels have blurred edges, as things very near to a lens do."""
FINE = 32
"""Texels of a module whose mean a coarser board is drawn from."""


def draw_tag(picture: Picture, tag: PadTag, forward: Array, right: Array) -> None:
    """Draws a tag's board into a sharp picture.

    ``forward``, ``right``: where the grid's nodes lie in the pad's axes, (rows, columns), metres.
    """
    x, y = _modules(tag, forward, right)
    x_down, x_across, y_down, y_across = (np.gradient(grid, axis=axis) for grid in (x, y) for axis in (0, 1))
    half = WITH_MARGIN / 2.0
    # Nodes on the board and those around it, one step farther: between them are its edges.
    near = (np.abs(x) <= half + np.abs(x_down) + np.abs(x_across)) & (
        np.abs(y) <= half + np.abs(y_down) + np.abs(y_across)
    )
    if not near.any():
        return
    (top, bottom), (left, right_end) = (_range(np.any(near, axis=axis)) for axis in (1, 0))
    middle = divmod(int(np.argmin(x * x + y * y)), x.shape[1])
    area = abs(x_down[middle] * y_across[middle] - x_across[middle] * y_down[middle])
    board = _board(tag.tag_id, _texels(STEP / sqrt(max(area, 1e-12))))
    scale = len(board) / WITH_MARGIN
    size = (picture.shape[1], picture.shape[0])
    u, window = to_pixels((x[top:bottom, left:right_end] + half) * scale - 0.5, (top, left), size)
    v, _ = to_pixels((y[top:bottom, left:right_end] + half) * scale - 0.5, (top, left), size)
    if not u.size:
        return
    # Outside the board both are 0: at its edges the paper covers a share of each pixel.
    paper = cv2.remap(board, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    share = cv2.remap(np.full_like(board, 255), u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    light = paper + (1.0 - share / np.float32(255.0)) * picture[window]
    picture[window] = np.clip(light + 0.5, 0, 255).astype(np.uint8)


def _modules(tag: PadTag, forward: Array, right: Array) -> tuple[Array, Array]:
    """Places on the tag's own print, modules right of and below its centre."""
    turn, module_m = radians(tag.printed.yaw_deg), tag.printed.size_m / MODULES
    ahead, aside = (forward - tag.printed.forward_m) / module_m, (right - tag.printed.right_m) / module_m
    c, s = cos(turn), sin(turn)
    return aside * c - ahead * s, -ahead * c - aside * s


def _range(flags: NDArray[np.bool_] | np.bool_) -> tuple[int, int]:
    """First index that is set and the one after the last."""
    found = np.flatnonzero(flags)
    return int(found[0]), int(found[-1]) + 1


def _texels(module_px: float) -> int:
    """Side of the board's picture, texels: as large as pixels, so that linear interpolation is the mean over a pixel.
    Whole texels a module, so that its edges are exact.
    """
    if module_px < 1.0:
        return max(1, ceil(WITH_MARGIN * module_px))
    return WITH_MARGIN * min(MOST_TEXELS, round(module_px))


@lru_cache(maxsize=64)
def _board(tag_id: int, texels: int) -> Picture:
    """Picture of a tag's board with this number of texels along its side."""
    board = board_picture(tag_id)
    if texels >= WITH_MARGIN:
        return _resized(board, texels, cv2.INTER_NEAREST)
    fine = _resized(board, FINE * WITH_MARGIN, cv2.INTER_NEAREST)
    return _resized(fine, texels, cv2.INTER_AREA)


def _resized(board: Picture, texels: int, interpolation: int) -> Picture:
    resized: Picture = cv2.resize(board, (texels, texels), interpolation=interpolation)
    return resized
