"""Outlier rejection: corners and pictures that disagree with the others are removed before the final fit.

The judge is the most flexible lens, so that the misfit of a short polynomial removes nothing. A corner that a detector
misplaced has a residual many times the usual one. A board that moved, bent or was misread has many such corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.bundle_adjustment import adjusted, residuals, with_flips_resolved
from fwav_companion.tools.calibrate.lens_fit.initial_estimate import initial_estimate, robust_weights
from fwav_companion.tools.calibrate.lens_fit.reprojection import (
    BoardCorners,
    BoardView,
    Flags,
    LensAndPoses,
    concatenated,
    with_coefficients,
)

MOST_COEFFICIENTS: Final = 5
FEWEST_CORNERS: Final = 6
"""Fewest corners of a view: four corners have as many coordinates as board pose and plane have parameters."""
CORNER_LIMIT: Final = 5.0
"""Largest residual of a good corner, sigmas of one axis: one in 270 sets of a thousand good corners loses a corner
(exp(-12.5) = 4e-6)."""
VIEW_LIMIT: Final = 3.0
"""Ratio of a view's median residual to the usual one, beyond which the view is dropped."""
MOST_OUTLIERS: Final = 0.3
"""Share of a view's corners that may be outliers; beyond it the view is dropped."""
FINEST_PX: Final = 1e-6
"""Smallest usual residual, pixels: a floor against division by zero where the corners fit exactly."""
ROUNDS: Final = 6
"""Most rounds of removal and refit; usually the second is the last."""
SIGMA_OF_MEDIAN: Final = 0.8493
"""Sigma of one axis over the median length of a two-dimensional residual: 1 / sqrt(2 ln 2)."""
STEPS: Final = 15
"""Adjustment steps of an intermediate fit."""


class DroppedView(msgspec.Struct, frozen=True):
    """A picture with a board that the fit does not use."""

    name: str
    """Name of the picture."""
    why: str
    """Reason, for the table of pictures."""
    rms_px: float
    """Residual RMS of one axis under a fit (nearly) without this view, pixels."""


class ConsistentViews(msgspec.Struct, frozen=True, eq=False):
    """The views that agree with one lens, and the views and corners that were removed."""

    views: tuple[BoardView, ...]
    """The remaining views, without the removed corners."""
    state: LensAndPoses
    """Fit to these views with the most coefficients."""
    dropped: tuple[DroppedView, ...]
    """The removed views."""
    corners_out: dict[str, int]
    """Number of removed corners, by the name of a remaining view."""


def consistent_views(views: Sequence[BoardView], image_size: tuple[int, int]) -> ConsistentViews:
    """The views that agree with one lens; they may be fewer than a fit needs."""
    corners = concatenated(views)
    state = _flexible_fit(corners, initial_estimate(corners, image_size))
    dropped: list[DroppedView] = []
    kept = list(range(len(views)))
    for _ in range(ROUNDS):
        off, bad = _outliers(corners, state, kept)
        dropped += [DroppedView(views[i].name, *why_and_rms) for i, why_and_rms in bad.items()]
        kept = [i for i in kept if i not in bad]
        if not kept:
            break
        before, state = state, _refitted(corners, state, kept, off)
        if not bad and np.allclose(before.lens, state.lens, rtol=1e-6, atol=1e-3):
            break
    inliers = {i: ~off[corners.view == i] for i in kept}
    return ConsistentViews(
        views=tuple(BoardView(views[i].name, views[i].board[of], views[i].pixels[of]) for i, of in inliers.items()),
        state=LensAndPoses(state.lens, state.rotations[kept], state.positions[kept]),
        dropped=tuple(dropped),
        corners_out={views[i].name: int((~of).sum()) for i, of in inliers.items() if not of.all()},
    )


def _flexible_fit(corners: BoardCorners, state: LensAndPoses) -> LensAndPoses:
    """The robust fit with the most coefficients, added one by one, and with flipped board poses resolved."""
    for count in range(2, MOST_COEFFICIENTS + 1):
        wider = with_coefficients(state, count)
        state = adjusted(corners, wider, robust_weights(corners, wider), STEPS)
    state = with_flips_resolved(corners, state)
    return adjusted(corners, state, robust_weights(corners, state), STEPS)


def _outliers(
    corners: BoardCorners, state: LensAndPoses, kept: Sequence[int]
) -> tuple[Flags, dict[int, tuple[str, float]]]:
    """The outlier flag of each corner, (M,); and by view to drop, the reason and the RMS of one axis in pixels."""
    miss = np.linalg.norm(residuals(corners, state), axis=1)
    typical = SIGMA_OF_MEDIAN * np.array([np.median(miss[corners.view == i]) for i in range(len(corners.starts))])
    usual = max(FINEST_PX, float(np.median(typical[kept])))
    off = miss > CORNER_LIMIT * np.maximum(usual, typical)[corners.view]
    bad: dict[int, tuple[str, float]] = {}
    for i in kept:
        of_view, rms = off[corners.view == i], float(np.sqrt((miss[corners.view == i] ** 2).mean() / 2.0))
        if typical[i] > VIEW_LIMIT * usual:
            bad[i] = (f"its reprojection error is {typical[i] / usual:.0f} times the usual one", rms)
        elif of_view.mean() > MOST_OUTLIERS or (~of_view).sum() < FEWEST_CORNERS:
            bad[i] = (f"{of_view.sum()} of its {len(of_view)} corners are outliers", rms)
    return off, bad


def _refitted(corners: BoardCorners, state: LensAndPoses, kept: Sequence[int], off: Flags) -> LensAndPoses:
    """The fit to the remaining views. A dropped view keeps a trace of weight, so that its pose stays determined."""
    inlier = np.isin(corners.view, kept) & ~off
    return adjusted(corners, state, np.where(inlier, 1.0, 1e-9 * ~off + 1e-12), STEPS)
