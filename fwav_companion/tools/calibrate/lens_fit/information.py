"""What the pictures tell of the lens, each by itself, and whether they agree.

The corners' own scatter is believed only as far as the pictures agree with one another. What a picture pulls the lens
by, beside what its scatter allows, is an error that all its corners share (a board that is not flat, blur, a finder's
bias), and widens every claim. What is wrong in all pictures alike, as a board that is bent for good, shows in part
only: as residuals that no lens takes away.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fwav_companion.tools.calibrate.lens_fit.adjustment import camera_points, normal_equations, residuals
from fwav_companion.tools.calibrate.lens_fit.corners import Corners, Floats, State
from fwav_companion.tools.calibrate.lens_fit.projection import project

SINGULAR: Final = 1e-13
"""Of the largest eigenvalue, with rows of one size: below it lies what rounding makes."""


def told_of_lens(corners: Corners, state: State) -> Floats:
    """(V, P, P) information of each view, its board standing anywhere; per pixel^2 of variance."""
    return normal_equations(corners, state, np.ones(len(corners.pixels))).per_view()


def inverse(matrix: Floats) -> Floats:
    """Of a positive matrix whose rows are of very unlike size. LinAlgError: it is none."""
    size = np.sqrt(np.maximum(np.diagonal(matrix), 0.0))
    if not size.min() > 0.0:
        raise np.linalg.LinAlgError("a number has no part in any residual")
    values, vectors = np.linalg.eigh(matrix / size[:, None] / size)
    if not values[0] > SINGULAR * values[-1]:
        raise np.linalg.LinAlgError("the numbers cannot be told apart")
    inverted: Floats = (vectors / values) @ vectors.T / size[:, None] / size
    return inverted


def widening(corners: Corners, state: State, variance: float) -> float:
    """By how much sigmas are too small that believe in the corners' scatter alone: 1, or more.

    The squared pulls of the pictures over what scatter of this variance would make of them, each less its own share in
    the answer; the root of it. LinAlgError: the lens is not determined.
    """
    _, _, by_lens = project(state.lens, camera_points(corners, state))
    pulls = corners.by_view((np.swapaxes(by_lens, 1, 2) @ residuals(corners, state)[..., None])[..., 0])
    told = told_of_lens(corners, state)
    covariance = inverse(told.sum(axis=0))
    seen = float(np.einsum("vi,ij,vj->", pulls, covariance, pulls))
    shares = covariance @ told
    own = np.einsum("vij,vji->", shares, shares)
    expected = variance * float(np.trace(shares, axis1=1, axis2=2).sum() - own)
    return float(np.sqrt(max(1.0, seen / expected))) if expected > 0.0 else 1.0
