"""Lens and boards together, by least squares on the corners' pixels (Levenberg and Marquardt).

Each board's six numbers touch its own corners only. They are worked out of the equations first (Schur), so that what is
left to solve is as large as the lens, whatever the number of pictures.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.corners import Corners, Floats, State
from fwav_companion.tools.calibrate.lens_fit.projection import project

STEPS: Final = 30
"""From a fair start ten are enough; only numbers that the corners hardly tell apart take more."""
SETTLED: Final = 1e-7
"""Of the sum of squares: a step that gains less ends the search. Of a thousand corners that is 2e-4 variances, and the
answer a hundredth of a sigma from the best."""
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-12, 1e8


class Normal(msgspec.Struct, frozen=True, eq=False):
    """The normal equations at a state, weights included, in blocks."""

    lens: Floats
    """(V, P, P) each view's share by lens and lens."""
    mixed: Floats
    """(V, 6, P) by board and lens."""
    board: Floats
    """(V, 6, 6) by board and board."""
    lens_pull: Floats
    """(V, P)."""
    board_pull: Floats
    """(V, 6)."""

    def per_view(self) -> Floats:
        """(V, P, P) what each view tells of the lens when its board may stand anywhere."""
        told: Floats = self.lens - _t(self.mixed) @ np.linalg.solve(self.board, self.mixed)
        return told


def residuals(corners: Corners, state: State) -> Floats:
    """(M, 2) pixels by which the corners lie off the lens's."""
    seen, _, _ = project(state.lens, camera_points(corners, state))
    return corners.pixels - seen


def camera_points(corners: Corners, state: State) -> Floats:
    """(M, 3) the corners in the camera frame, metres."""
    points: Floats = _arms(corners, state) + state.places[corners.view]
    return points


def adjusted(corners: Corners, state: State, weights: Floats, steps: int = STEPS) -> State:
    """The state with the least weighted sum of squares, near to the one that is given; ``weights``: (M,)."""
    damping = FIRST_DAMPING
    cost, normal = _look(corners, state, weights)
    for _ in range(steps):
        trial = _moved(state, normal, damping)
        trial_cost, trial_normal = (np.inf, normal) if trial is None else _look(corners, trial, weights)
        if trial is None or not trial_cost < cost:
            if damping >= MOST_DAMPING or abs(trial_cost - cost) <= SETTLED * cost:
                break
            damping *= 10.0
            continue
        gained, cost, state, normal = cost - trial_cost, trial_cost, trial, trial_normal
        damping = max(damping / 10.0, LEAST_DAMPING)
        if gained <= SETTLED * cost:
            break
    return state


def normal_equations(corners: Corners, state: State, weights: Floats) -> Normal:
    """At this state."""
    return _look(corners, state, weights)[1]


def _arms(corners: Corners, state: State) -> Floats:
    arms: Floats = (state.turns[corners.view] @ corners.board[:, :, None])[..., 0]
    return arms


def _look(corners: Corners, state: State, weights: Floats) -> tuple[float, Normal]:
    """The weighted sum of squares, and the equations."""
    residual, by_board, by_lens = jacobians(corners, state)
    squares = float((weights * (residual**2).sum(axis=1)).sum())
    return squares, equations(corners, residual, by_board, by_lens, weights)


def jacobians(corners: Corners, state: State) -> tuple[Floats, Floats, Floats]:
    """(M, 2) residuals, pixels; (M, 2, 6) of the pixels by their own board's turn and place; (M, 2, P) by the lens."""
    arms = _arms(corners, state)
    seen, by_point, by_lens = project(state.lens, arms + state.places[corners.view])
    by_board = np.concatenate([np.cross(arms[:, None, :], by_point), by_point], axis=-1)
    return corners.pixels - seen, by_board, by_lens


def equations(corners: Corners, residual: Floats, by_board: Floats, by_lens: Floats, weights: Floats) -> Normal:
    """Of these derivatives, which may be by more than a lens has."""
    weight, column = weights[:, None, None], residual[..., None]
    of_board, of_lens = _t(by_board) * weight, _t(by_lens) * weight
    return Normal(
        corners.by_view(of_lens @ by_lens),
        corners.by_view(of_board @ by_lens),
        corners.by_view(of_board @ by_board),
        corners.by_view(of_lens @ column)[..., 0],
        corners.by_view(of_board @ column)[..., 0],
    )


def _moved(state: State, normal: Normal, damping: float) -> State | None:
    """One damped step; None where the equations cannot be solved."""
    try:
        board = _damped(normal.board, damping)
        gain = np.linalg.solve(board, np.concatenate([normal.mixed, normal.board_pull[..., None]], axis=-1))
        by_lens, alone = gain[..., :-1], gain[..., -1]
        whole = _damped(normal.lens.sum(axis=0), damping) - (_t(normal.mixed) @ by_lens).sum(axis=0)
        pull = (normal.lens_pull - (_t(normal.mixed) @ alone[..., None])[..., 0]).sum(axis=0)
        lens_step = np.linalg.solve(whole, pull)
    except np.linalg.LinAlgError:
        return None
    step = alone - by_lens @ lens_step
    return State(state.lens + lens_step, exp(step[:, :3]) @ state.turns, state.places + step[:, 3:])


def _damped(matrix: Floats, damping: float) -> Floats:
    """Its diagonal a little larger, and never zero."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    added = damping * diagonal + 1e-14 * diagonal.max(axis=-1, keepdims=True) + 1e-300
    stiffer: Floats = matrix + added[..., None] * np.eye(matrix.shape[-1])
    return stiffer


def exp(v: Floats) -> Floats:
    """(V, 3, 3) rotations by |v| radians about v, of (V, 3) vectors (Rodrigues)."""
    angle = np.linalg.norm(v, axis=-1)[:, None, None]
    once = np.cross(np.eye(3), v[:, None, :])  # row i is e_i x v: the matrix of v x
    turned: Floats = (
        np.eye(3) + np.sinc(angle / np.pi) * once + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * (once @ once)
    )
    return turned


def _t(matrix: Floats) -> Floats:
    return np.swapaxes(matrix, -1, -2)
