"""Board corners in pictures, the parameters that explain them, and the projection with all its derivatives.

    theta = atan2(hypot(x, y), z),   phi = atan2(y, x)
    r(theta) = c1 theta + c2 theta^3 + ... + cn theta^(2n - 1)        pixels along u
    u = u0 + r cos(phi),   v = v0 + aspect r sin(phi)

In terms of the camera file c_i is pixels_per_mm[0] k_i, and the aspect ratio pixels_per_mm[1] / pixels_per_mm[0]: only
these products and this ratio are observable.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]

U0, V0, ASPECT, RADIAL = 0, 1, 2, 3
"""Indices of the lens parameters; the rest is c1, c2, ..."""
NEAREST: Final = 1e-12
"""Smallest distance from the axis, as a share of a point's distance: nearer, the direction phi has no effect."""


class BoardView(msgspec.Struct, frozen=True, eq=False):
    """The board's corners in one picture."""

    name: str
    """Name of the picture."""
    board: Floats
    """Corners on the board, (N, 2), metres."""
    pixels: Floats
    """Corners in the picture, (N, 2), pixels."""


class BoardCorners(msgspec.Struct, frozen=True, eq=False):
    """The corners of all views, one view after another."""

    board: Floats
    """Corners on the board, (M, 3), metres; the third coordinate is zero."""
    pixels: Floats
    """Corners in the pictures, (M, 2), pixels."""
    view: NDArray[np.intp]
    """Index of each corner's view, (M,)."""
    starts: NDArray[np.intp]
    """Index of each view's first corner, (V,)."""

    def by_view(self, values: Floats) -> Floats:
        """The sums over each view, (V, ...), of (M, ...) values."""
        sums: Floats = np.add.reduceat(values, self.starts, axis=0)
        return sums


class LensAndPoses(msgspec.Struct, frozen=True, eq=False):
    """The parameters of the adjustment: a lens, and the pose of each view's board."""

    lens: Floats
    """u0, v0, aspect ratio, c1 .. cn; pixels."""
    rotations: Floats
    """Rotations camera_from_board, (V, 3, 3)."""
    positions: Floats
    """Board origins in the camera frame, (V, 3), metres."""


def concatenated(views: Sequence[BoardView]) -> BoardCorners:
    """The corners of at least one view, each with at least one corner."""
    counts = [len(view.pixels) for view in views]
    board = np.concatenate([view.board for view in views])
    return BoardCorners(
        board=np.concatenate([board, np.zeros((len(board), 1))], axis=1),
        pixels=np.concatenate([view.pixels for view in views]),
        view=np.repeat(np.arange(len(views)), counts),
        starts=np.cumsum([0, *counts[:-1]]),
    )


def with_coefficients(state: LensAndPoses, count: int) -> LensAndPoses:
    """The same state with ``count`` radial coefficients: new ones are zero, surplus ones are dropped."""
    lens = np.concatenate([state.lens, np.zeros(max(0, RADIAL + count - len(state.lens)))])[: RADIAL + count]
    return LensAndPoses(lens, state.rotations, state.positions)


def odd_powers(theta: Floats, count: int) -> tuple[Floats, Floats]:
    """Theta, theta^3, ... as (M, count), and their derivatives by theta."""
    orders = 2 * np.arange(count) + 1
    even = theta[..., None] ** (2 * np.arange(count))
    return even * theta[..., None], even * orders


def radius(lens: Floats, theta: Floats) -> Floats:
    """The image radius r(theta), pixels."""
    odd, _ = odd_powers(theta, len(lens) - RADIAL)
    r: Floats = odd @ lens[RADIAL:]
    return r


def radius_slope(lens: Floats, theta: Floats) -> Floats:
    """The slope dr/dtheta, pixels a radian."""
    _, even = odd_powers(theta, len(lens) - RADIAL)
    slope: Floats = even @ lens[RADIAL:]
    return slope


def angles_from_axis(points: Floats) -> Floats:
    """The angles theta of (M, 3) points in the camera frame from the optical axis, (M,), radians."""
    theta: Floats = np.arctan2(np.hypot(points[..., 0], points[..., 1]), points[..., 2])
    return theta


def project(lens: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
    """Pixels, (M, 2), of (M, 3) points in the camera frame; Jacobians by point, (M, 2, 3), and lens, (M, 2, 3 + n)."""
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    square = x * x + y * y + z * z
    across = np.hypot(x, y) + NEAREST * np.sqrt(square)
    theta = np.arctan2(across, z)
    odd, even = odd_powers(theta, len(lens) - RADIAL)
    r, slope = odd @ lens[RADIAL:], even @ lens[RADIAL:]
    cosine, sine, aspect = x / across, y / across, lens[ASPECT]
    g = r / across
    outward = slope * z / square - g
    plane = np.stack([np.stack([cosine, sine, -slope * across / square], axis=-1)] * 2, axis=1)
    plane[:, :, :2] *= outward[:, None, None]
    by_point = plane * np.stack([cosine, sine], axis=-1)[:, :, None]
    by_point[:, 0, 0] += g
    by_point[:, 1, 1] += g
    by_point[:, 1] *= aspect
    by_lens = np.zeros((len(points), 2, len(lens)))
    by_lens[:, 0, U0] = by_lens[:, 1, V0] = 1.0
    by_lens[:, 1, ASPECT] = r * sine
    by_lens[:, 0, RADIAL:] = odd * cosine[:, None]
    by_lens[:, 1, RADIAL:] = odd * (aspect * sine)[:, None]
    pixels = np.stack([lens[U0] + r * cosine, lens[V0] + aspect * r * sine], axis=-1)
    return pixels, by_point, by_lens
