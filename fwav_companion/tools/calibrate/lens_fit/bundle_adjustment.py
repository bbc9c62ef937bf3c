"""Bundle adjustment: the lens and all board poses by least squares on the corners' pixels.

The method is Levenberg-Marquardt (Levenberg 1944; Marquardt 1963) with the board poses eliminated by the Schur
complement (Triggs et al. 2000, section 6). Each pose has six parameters that only its own corners depend on, so that
the remaining system is as large as the lens, whatever the number of pictures.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardCorners, Floats, LensAndPoses, project

STEPS: Final = 30
"""Most steps. Ten are enough from a good start; only parameters that the corners hardly separate take more."""
SETTLED: Final = 1e-7
"""Relative decrease of the sum of squares at which the search ends. With a thousand corners this is 2e-4 variances, and
the answer a hundredth of a sigma from the optimum."""
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-12, 1e8
FLIP_STEPS: Final = 8
"""Gauss-Newton steps from a flipped pose; five are enough."""
FLIP_DAMPING: Final = 1e-9
"""Share of the trace added to the diagonal, so that corners on one line cannot make the system singular."""


class NormalEquations(msgspec.Struct, frozen=True, eq=False):
    """The weighted normal equations at a state, in blocks of the lens and of each view's board pose."""

    lens: Floats
    """Lens by lens, the share of each view, (V, P, P)."""
    board_by_lens: Floats
    """Board pose by lens, (V, 6, P)."""
    board: Floats
    """Board pose by board pose, (V, 6, 6)."""
    lens_gradient: Floats
    """Right-hand side of the lens, the share of each view, (V, P)."""
    board_gradient: Floats
    """Right-hand side of the board poses, (V, 6)."""

    def lens_information(self) -> Floats:
        """The information of each view on the lens with its board pose free, (V, P, P): the Schur complement."""
        information: Floats = self.lens - _t(self.board_by_lens) @ np.linalg.solve(self.board, self.board_by_lens)
        return information


def residuals(corners: BoardCorners, state: LensAndPoses) -> Floats:
    """Observed minus projected pixels, (M, 2)."""
    projected, _, _ = project(state.lens, camera_points(corners, state))
    return corners.pixels - projected


def camera_points(corners: BoardCorners, state: LensAndPoses) -> Floats:
    """The corners in the camera frame, (M, 3), metres."""
    points: Floats = _rotated(corners, state) + state.positions[corners.view]
    return points


def adjusted(corners: BoardCorners, state: LensAndPoses, weights: Floats, steps: int = STEPS) -> LensAndPoses:
    """The state at the local minimum of the weighted sum of squares; ``weights``: (M,), one for each corner."""
    damping = FIRST_DAMPING
    cost, normal = _cost_and_equations(corners, state, weights)
    for _ in range(steps):
        trial = _damped_step(state, normal, damping)
        trial_cost, trial_normal = (np.inf, normal) if trial is None else _cost_and_equations(corners, trial, weights)
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


def normal_equations(corners: BoardCorners, state: LensAndPoses, weights: Floats) -> NormalEquations:
    """The normal equations at this state."""
    return _cost_and_equations(corners, state, weights)[1]


def jacobians(corners: BoardCorners, state: LensAndPoses) -> tuple[Floats, Floats, Floats]:
    """Residuals, (M, 2); Jacobians of the pixels by rotation and position, (M, 2, 6), and by the lens, (M, 2, P)."""
    rotated = _rotated(corners, state)
    projected, by_point, by_lens = project(state.lens, rotated + state.positions[corners.view])
    by_board = np.concatenate([np.cross(rotated[:, None, :], by_point), by_point], axis=-1)
    return corners.pixels - projected, by_board, by_lens


def equations(
    corners: BoardCorners, residual: Floats, by_board: Floats, by_lens: Floats, weights: Floats
) -> NormalEquations:
    """The normal equations of these Jacobians; ``by_lens`` may have columns beyond the parameters of a lens."""
    weight, column = weights[:, None, None], residual[..., None]
    of_board, of_lens = _t(by_board) * weight, _t(by_lens) * weight
    return NormalEquations(
        lens=corners.by_view(of_lens @ by_lens),
        board_by_lens=corners.by_view(of_board @ by_lens),
        board=corners.by_view(of_board @ by_board),
        lens_gradient=corners.by_view(of_lens @ column)[..., 0],
        board_gradient=corners.by_view(of_board @ column)[..., 0],
    )


def with_flips_resolved(corners: BoardCorners, state: LensAndPoses) -> LensAndPoses:
    """The same lens, with each board in its pose or in the flipped one, whichever has the smaller residuals.

    A board that is seen from afar has two poses with nearly the same image: it is tilted towards or away from the
    camera (Schweighofer & Pinz 2006). A search that starts from the wrong pose stays there, some pixels off.
    """
    flipped = _poses_adjusted(corners, LensAndPoses(state.lens, _flipped_rotations(corners, state), state.positions))
    as_is, other = (corners.by_view((residuals(corners, each) ** 2).sum(axis=1)) for each in (state, flipped))
    better = np.nan_to_num(other, nan=np.inf) < as_is
    return LensAndPoses(
        state.lens,
        np.where(better[:, None, None], flipped.rotations, state.rotations),
        np.where(better[:, None], flipped.positions, state.positions),
    )


def _flipped_rotations(corners: BoardCorners, state: LensAndPoses) -> Floats:
    """The rotations (V, 3, 3) after half a turn about the line of sight, and half a turn about the board's normal."""
    count = corners.by_view(np.ones(len(corners.view)))
    centres = (
        state.positions + (state.rotations @ (corners.by_view(corners.board) / count[:, None])[:, :, None])[..., 0]
    )
    sight = centres / np.linalg.norm(centres, axis=1, keepdims=True)
    half_turn = 2.0 * sight[:, :, None] * sight[:, None, :] - np.eye(3)
    flipped: Floats = half_turn @ state.rotations @ np.diag([-1.0, -1.0, 1.0])
    return flipped


def _poses_adjusted(corners: BoardCorners, state: LensAndPoses) -> LensAndPoses:
    """The state with each board pose at its optimum for this lens, by Gauss-Newton."""
    weights = np.ones(len(corners.view))
    for _ in range(FLIP_STEPS):
        normal = normal_equations(corners, state, weights)
        largest = np.trace(normal.board, axis1=1, axis2=2)[:, None, None]
        step = np.linalg.solve(normal.board + FLIP_DAMPING * largest * np.eye(6), normal.board_gradient[..., None])
        state = _moved(state, np.zeros(len(state.lens)), step[..., 0])
    return state


def _rotated(corners: BoardCorners, state: LensAndPoses) -> Floats:
    """Vectors from each board's origin to its corners in camera axes, (M, 3), metres."""
    rotated: Floats = (state.rotations[corners.view] @ corners.board[:, :, None])[..., 0]
    return rotated


def _cost_and_equations(corners: BoardCorners, state: LensAndPoses, weights: Floats) -> tuple[float, NormalEquations]:
    """The weighted sum of squares, and the normal equations."""
    residual, by_board, by_lens = jacobians(corners, state)
    squares = float((weights * (residual**2).sum(axis=1)).sum())
    return squares, equations(corners, residual, by_board=by_board, by_lens=by_lens, weights=weights)


def _damped_step(state: LensAndPoses, normal: NormalEquations, damping: float) -> LensAndPoses | None:
    """The state after one damped step; None where the equations are singular."""
    try:
        board = _damped(normal.board, damping)
        gain = np.linalg.solve(board, np.concatenate([normal.board_by_lens, normal.board_gradient[..., None]], axis=-1))
        by_lens, alone = gain[..., :-1], gain[..., -1]
        reduced = _damped(normal.lens.sum(axis=0), damping) - (_t(normal.board_by_lens) @ by_lens).sum(axis=0)
        gradient = (normal.lens_gradient - (_t(normal.board_by_lens) @ alone[..., None])[..., 0]).sum(axis=0)
        lens_step = np.linalg.solve(reduced, gradient)
    except np.linalg.LinAlgError:
        return None
    return _moved(state, lens_step, alone - by_lens @ lens_step)


def _moved(state: LensAndPoses, lens_step: Floats, board_step: Floats) -> LensAndPoses:
    return LensAndPoses(
        state.lens + lens_step,
        rotations_from_vectors(board_step[:, :3]) @ state.rotations,
        state.positions + board_step[:, 3:],
    )


def _damped(matrix: Floats, damping: float) -> Floats:
    """The matrix with its diagonal enlarged by the damping (Marquardt's scaling), and never zero."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    added = damping * diagonal + 1e-14 * diagonal.max(axis=-1, keepdims=True) + 1e-300
    damped: Floats = matrix + added[..., None] * np.eye(matrix.shape[-1])
    return damped


def rotations_from_vectors(v: Floats) -> Floats:
    """Rotations by |v| radians about v, (V, 3, 3), of (V, 3) rotation vectors (Rodrigues)."""
    angle = np.linalg.norm(v, axis=-1)[:, None, None]
    once = np.cross(np.eye(3), v[:, None, :])  # row i is e_i x v: the matrix of v x
    rotations: Floats = (
        np.eye(3) + np.sinc(angle / np.pi) * once + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * (once @ once)
    )
    return rotations


def _t(matrix: Floats) -> Floats:
    return np.swapaxes(matrix, -1, -2)
