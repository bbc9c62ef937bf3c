"""Finds a clicked spot in the next picture by normalised correlation with its predicted patch. PURE.

The geometry predicts the place of the spot and its rotation and scale, so the search is short and the template needs
no update that could drift. A match is accepted against views that were cut once (Lewis 1995, fast normalised
cross-correlation), refined to a fraction of a pixel (Lucas & Kanade 1981), and checked backwards (Kalal, Mikolajczyk &
Matas 2010, forward-backward error). A place that is not clearly the spot is rejected with a reason.
"""

from __future__ import annotations

from enum import StrEnum
from math import ceil, dist
from typing import Final

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from fwav_companion.types.spots import SpotView
from fwav_companion.vision.patch.appearance import HALF_PX, Appearance, Image, cut, jacobian

LEAST_TEXTURE: Final = 6.0
"""Standard deviation of the patch, grey levels: twice the noise of a small sensor at dusk (2 to 3)."""
LEAST_CORRELATION: Final = 0.70
LEAST_LEAD: Final = 0.08
"""Least correlation by which the best place must exceed the second best one."""
APART_PX: Final = 6
"""Places closer together than this belong to one peak of the correlation, pixels: a stone of this size."""
MOST_REACH_PX: Final = 96
"""Largest reach of the search, pixels: beyond it the vehicle's motion is not known well enough for a prediction."""
FLOOR_PX: Final = 0.35
"""One sigma of a perfect match: its shift by motion blur and by another viewing direction, on rendered flights."""
MOST_BACKWARD_PX: Final = 0.5
"""Largest forward-backward error, pixels."""
MOST_REFINED_PX: Final = 2.0
"""Largest refinement, pixels: correlation finds whole pixels, and a larger shift moves to another detail."""
SIDE_PX: Final = 2 * HALF_PX + 1
REFINE_WINDOW: Final = (2 * HALF_PX - 5, 2 * HALF_PX - 5)
KEY_CORRELATION: Final = 0.85
"""Least correlation of a match that may become a key view."""
REFINE_STOP: Final = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.01)


class NoMatch(StrEnum):
    """Reasons why a spot is not found in a picture."""

    OUTSIDE = "outside"
    """It is predicted outside the picture, or too close to its edge."""
    NO_TEXTURE = "no_texture"
    """The patch is nearly uniform: any place would resemble it."""
    UNLIKE = "unlike"
    """No place within reach resembles it: it is covered, blurred, or the prediction is wrong."""
    AMBIGUOUS = "ambiguous"
    """Two places within reach resemble it."""
    FORGOTTEN = "forgotten"
    """The picture that was clicked on is not kept any more."""
    UNSTABLE = "unstable"
    """The backward check of the refinement did not return to its start."""


class PatchMatch(msgspec.Struct, frozen=True):
    """A spot that was found."""

    at: tuple[float, float]
    """Its pixel."""
    sigma_px: float
    """One standard deviation of an axis."""
    correlation: float
    """Correlation of the predicted patch with the picture, up to 1."""


class PatchTracker:
    """Follows one spot through pictures."""

    def __init__(self, appearance: Appearance) -> None:
        self._appearance = appearance

    @classmethod
    def initiate(cls, picture: Image, view: SpotView) -> PatchTracker | NoMatch:
        """The tracker of the spot at ``view.at``, or why this spot cannot be followed."""
        first = cut(picture, view.at, jacobian(view))
        if first is None:
            return NoMatch.OUTSIDE
        appearance = Appearance(first)
        if float(appearance.predicted(jacobian(view)).std()) < LEAST_TEXTURE:
            return NoMatch.NO_TEXTURE
        return cls(appearance)

    def update(self, picture: Image, view: SpotView) -> PatchMatch | NoMatch:
        """The spot's place in this picture, or why it is not found."""
        if not _inside(picture, view.at):
            return NoMatch.OUTSIDE
        template = self._appearance.predicted(jacobian(view))
        if float(template.std()) < LEAST_TEXTURE:
            return NoMatch.NO_TEXTURE
        found = _search(picture, template, view)
        if isinstance(found, NoMatch):
            return found
        refined = _refine(picture, template, found.at)
        if refined is None:
            return NoMatch.UNSTABLE
        match = PatchMatch(refined, _sigma_px(template, found.correlation), found.correlation)
        self._learn(picture, match, view)
        return match

    def _learn(self, picture: Image, match: PatchMatch, view: SpotView) -> None:
        """Keep a good view from a new direction or distance."""
        if match.correlation >= KEY_CORRELATION:
            look = cut(picture, match.at, jacobian(view))
            if look is not None:
                self._appearance.add(look)


class _Peak(msgspec.Struct, frozen=True):
    at: tuple[float, float]
    correlation: float


def _search(picture: Image, template: NDArray[np.float32], view: SpotView) -> _Peak | NoMatch:
    """The best place within reach, by normalised correlation."""
    reach = ceil(min(view.reach_px, MOST_REACH_PX))
    window, corner = _window(picture, view.at, HALF_PX + reach)
    if min(window.shape) < SIDE_PX:
        return NoMatch.OUTSIDE
    scores = cv2.matchTemplate(window.astype(np.float32), template, cv2.TM_CCOEFF_NORMED)
    _, best, _, (x, y) = cv2.minMaxLoc(scores)
    if best < LEAST_CORRELATION:
        return NoMatch.UNLIKE
    left, top = max(0, x - APART_PX), max(0, y - APART_PX)
    rest = scores.copy()
    rest[top : y + APART_PX + 1, left : x + APART_PX + 1] = -1.0
    if float(rest.max()) > best - LEAST_LEAD:
        return NoMatch.AMBIGUOUS
    return _Peak((corner[0] + x + HALF_PX, corner[1] + y + HALF_PX), float(best))


def _refine(picture: Image, template: NDArray[np.float32], at: tuple[float, float]) -> tuple[float, float] | None:
    """The place to a fraction of a pixel, by Lucas-Kanade from the predicted patch; None if it is unstable."""
    patch = cv2.getRectSubPix(picture, (SIDE_PX, SIDE_PX), at)
    look = np.clip(template, 0.0, 255.0).astype(np.uint8)
    middle = (float(HALF_PX), float(HALF_PX))
    there = _flow(look, patch, middle)
    back = None if there is None else _flow(patch, look, there)
    if there is None or back is None or dist(back, middle) > MOST_BACKWARD_PX or dist(there, middle) > MOST_REFINED_PX:
        return None
    return (at[0] + there[0] - middle[0], at[1] + there[1] - middle[1])


def _flow(before: Image, after: Image, point: tuple[float, float]) -> tuple[float, float] | None:
    """The place of a point of one picture in the other, by Lucas-Kanade; None if it does not converge."""
    points = np.array([[point]], np.float32)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(
        before, after, points, points.copy(), winSize=REFINE_WINDOW, maxLevel=0, criteria=REFINE_STOP
    )
    return (float(moved[0, 0, 0]), float(moved[0, 0, 1])) if found[0, 0] else None


def _sigma_px(template: NDArray[np.float32], correlation: float) -> float:
    """One sigma of an axis: the Cramer-Rao bound of the patch's gradients and its residual, and a floor."""
    residual = float(template.std()) * np.sqrt(max(0.0, 1.0 - correlation**2))
    gy, gx = np.gradient(template)
    weakest = np.linalg.eigvalsh([[np.sum(gx * gx), np.sum(gx * gy)], [np.sum(gx * gy), np.sum(gy * gy)]])[0]
    return float(np.hypot(FLOOR_PX, residual / np.sqrt(max(weakest, 1.0))))


def _inside(picture: Image, at: tuple[float, float]) -> bool:
    height, width = picture.shape
    return bool(HALF_PX <= at[0] <= width - 1 - HALF_PX and HALF_PX <= at[1] <= height - 1 - HALF_PX)


def _window(picture: Image, at: tuple[float, float], half: int) -> tuple[Image, tuple[int, int]]:
    """(the part of the picture around a pixel, its corner), cut at the edges."""
    height, width = picture.shape
    u, v = round(at[0]), round(at[1])
    left, top = max(0, u - half), max(0, v - half)
    return picture[top : min(height, v + half + 1), left : min(width, u + half + 1)], (left, top)
