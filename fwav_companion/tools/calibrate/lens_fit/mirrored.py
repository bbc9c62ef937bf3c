"""The other pose of a flat board: seen from afar, tilted towards or away it looks nearly the same.

A search that began with the wrong one of the two stays there, some pixels off. So both are tried for every picture.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fwav_companion.tools.calibrate.lens_fit.adjustment import exp, normal_equations, residuals
from fwav_companion.tools.calibrate.lens_fit.corners import Corners, Floats, State

STEPS: Final = 8
"""Of Gauss and Newton; from the mirrored pose five are enough."""
STIFFER: Final = 1e-9
"""Of the diagonal, so that corners in one line cannot stop the others."""


def with_better_poses(corners: Corners, state: State) -> State:
    """The same lens; each board as it stands or as its mirror image does, whichever misses less."""
    mirrored = _settled(corners, State(state.lens, _mirrored(corners, state), state.places))
    as_is, other = (corners.by_view((residuals(corners, each) ** 2).sum(axis=1)) for each in (state, mirrored))
    better = np.nan_to_num(other, nan=np.inf) < as_is
    return State(
        state.lens,
        np.where(better[:, None, None], mirrored.turns, state.turns),
        np.where(better[:, None], mirrored.places, state.places),
    )


def _mirrored(corners: Corners, state: State) -> Floats:
    """(V, 3, 3) turned about the line of sight by half a turn, and back about the board's own normal."""
    count = corners.by_view(np.ones(len(corners.view)))
    middles = state.places + (state.turns @ (corners.by_view(corners.board) / count[:, None])[:, :, None])[..., 0]
    sight = middles / np.linalg.norm(middles, axis=1, keepdims=True)
    half_turn = 2.0 * sight[:, :, None] * sight[:, None, :] - np.eye(3)
    turned: Floats = half_turn @ state.turns @ np.diag([-1.0, -1.0, 1.0])
    return turned


def _settled(corners: Corners, state: State) -> State:
    """Each board where it fits the lens best."""
    weights = np.ones(len(corners.view))
    for _ in range(STEPS):
        normal = normal_equations(corners, state, weights)
        largest = np.trace(normal.board, axis1=1, axis2=2)[:, None, None]
        step = np.linalg.solve(normal.board + STIFFER * largest * np.eye(6), normal.board_pull[..., None])[..., 0]
        state = State(state.lens, exp(step[:, :3]) @ state.turns, state.places + step[:, 3:])
    return state
