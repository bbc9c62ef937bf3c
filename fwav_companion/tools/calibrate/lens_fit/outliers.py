"""Corners and pictures that do not belong, found under the most flexible lens: its own misfit throws out nothing.

A corner that a finder put elsewhere misses by many times what the others do; a board that moved, bent or was misread
misses in many corners at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.adjustment import adjusted, residuals
from fwav_companion.tools.calibrate.lens_fit.corners import Corners, Flags, State, View, gather
from fwav_companion.tools.calibrate.lens_fit.mirrored import with_better_poses
from fwav_companion.tools.calibrate.lens_fit.starting import first_state, soft_weights, with_coefficients

MOST_COEFFICIENTS: Final = 5
FEWEST_CORNERS: Final = 6
"""A board of four has as many numbers as it stands at: it tells nothing."""
OFF: Final = 5.0
"""Sigmas of one axis: of a thousand good corners one in 270 sets loses one (exp(-12.5) = 4e-6)."""
ROUGH: Final = 3.0
"""A picture that misses by so many times what the typical one does."""
MOST_OFF: Final = 0.3
"""Of a picture's corners: where more are off, none is believed."""
FINEST_PX: Final = 1e-6
"""No picture shows corners better: where they do not miss at all, nothing may be divided by that."""
ROUNDS: Final = 6
"""Of throwing out and fitting again; the second is mostly the last."""
RMS_OF_MEDIAN: Final = 0.8493
"""The sigma of one axis by the median distance of two: 1 / sqrt(2 ln 2)."""
STEPS: Final = 15
"""Of one fit among several that lead to the answer."""


class Dropped(msgspec.Struct, frozen=True):
    """A picture that is not used."""

    name: str
    why: str
    rms_px: float
    """By which its corners miss, an axis, under a fit without it or nearly so."""


class Sound(msgspec.Struct, frozen=True, eq=False):
    """What is left."""

    views: tuple[View, ...]
    """Without the corners that were thrown out."""
    state: State
    """Of as many coefficients as there may be."""
    dropped: tuple[Dropped, ...]
    corners_out: dict[str, int]
    """By picture, of those that are used."""


def sound_views(views: Sequence[View], size: tuple[int, int]) -> Sound:
    """The views that agree with one lens; they may be fewer than a fit needs."""
    corners = gather(views)
    state = _flexible(corners, first_state(corners, size))
    dropped: list[Dropped] = []
    kept = list(range(len(views)))
    for _ in range(ROUNDS):
        off, bad = _judged(corners, state, kept)
        dropped += [Dropped(views[i].name, *told) for i, told in bad.items()]
        kept = [i for i in kept if i not in bad]
        if not kept:
            break
        before, state = state, _refitted(corners, state, kept, off)
        if not bad and np.allclose(before.lens, state.lens, rtol=1e-6, atol=1e-3):
            break
    return _sound(views, corners, state, kept, off, dropped)


def _sound(
    views: Sequence[View], corners: Corners, state: State, kept: list[int], off: Flags, dropped: list[Dropped]
) -> Sound:
    fine = [~off[corners.view == i] for i in kept]
    left = [
        View(views[i].name, views[i].board[good], views[i].pixels[good]) for i, good in zip(kept, fine, strict=True)
    ]
    out = {views[i].name: int((~good).sum()) for i, good in zip(kept, fine, strict=True) if not good.all()}
    return Sound(tuple(left), State(state.lens, state.turns[kept], state.places[kept]), tuple(dropped), out)


def _flexible(corners: Corners, state: State) -> State:
    """All coefficients, one after the other, while corners far off have little pull."""
    for count in range(2, MOST_COEFFICIENTS + 1):
        wider = with_coefficients(state, count)
        state = adjusted(corners, wider, soft_weights(corners, wider), STEPS)
    state = with_better_poses(corners, state)
    return adjusted(corners, state, soft_weights(corners, state), STEPS)


def _judged(corners: Corners, state: State, kept: Sequence[int]) -> tuple[Flags, dict[int, tuple[str, float]]]:
    """(M,) the corners that are off; the views that are, with why and by how much."""
    miss = np.linalg.norm(residuals(corners, state), axis=1)
    typical = RMS_OF_MEDIAN * np.array([np.median(miss[corners.view == i]) for i in range(len(corners.starts))])
    usual = max(FINEST_PX, float(np.median(typical[kept])))
    off = miss > OFF * np.maximum(usual, typical)[corners.view]
    bad: dict[int, tuple[str, float]] = {}
    for i in kept:
        of_view, rms = off[corners.view == i], float(np.sqrt((miss[corners.view == i] ** 2).mean() / 2.0))
        if typical[i] > ROUGH * usual:
            bad[i] = (f"its corners miss by {typical[i] / usual:.0f} times what is usual", rms)
        elif of_view.mean() > MOST_OFF or (~of_view).sum() < FEWEST_CORNERS:
            bad[i] = (f"{of_view.sum()} of its {len(of_view)} corners are off", rms)
    return off, bad


def _refitted(corners: Corners, state: State, kept: Sequence[int], off: Flags) -> State:
    """On what is kept. A view that is not keeps a trace of weight, so that its own board can still be placed."""
    believed = np.isin(corners.view, kept) & ~off
    return adjusted(corners, state, np.where(believed, 1.0, 1e-9 * ~off + 1e-12), STEPS)
