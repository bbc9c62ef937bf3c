"""Where the search begins, without a guess: boards by a closed form for some equidistant lenses, the best of them kept.

For a lens that is known, a flat board's place follows from its rays alone: d x H (x, y, 1) = 0 is linear in the nine
numbers of H = [r1 r2 t] (the plane's homography, on rays in place of pixels, so beyond 90 degrees too). The lens is one
number of twelve tried, r = f theta about the image's middle.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fwav_companion.tools.calibrate.lens_fit.adjustment import adjusted, residuals
from fwav_companion.tools.calibrate.lens_fit.corners import Corners, Floats, State

EDGE_ANGLES: Final = np.radians([4.0, 6.0, 9.0, 13.0, 19.0, 28.0, 40.0, 55.0, 75.0, 100.0, 130.0, 170.0])
"""From the axis to the corner of the image, each some half as much again as the one before."""
TRIED_FURTHER: Final = 4
STEPS: Final = 12
"""Of the lenses that are tried further: enough to see which is right."""
DAMPED: Final = 4.0
"""Corners that miss by more than so many typical misses count for less and less (Cauchy)."""


def first_state(corners: Corners, size: tuple[int, int]) -> State:
    """The state with one coefficient under which the typical corner misses least; ``size``: width, height."""
    candidates = [_with_focal(corners, size, angle) for angle in EDGE_ANGLES]
    candidates.sort(key=lambda state: typical_miss(corners, state))
    refined = [_refined(corners, state) for state in candidates[:TRIED_FURTHER]]
    return min(refined, key=lambda state: typical_miss(corners, state))


def typical_miss(corners: Corners, state: State) -> float:
    """The median distance of a corner from where it should be, pixels; infinite for a lens that is none."""
    miss = float(np.median(np.linalg.norm(residuals(corners, state), axis=1)))
    return miss if np.isfinite(miss) else np.inf


def soft_weights(corners: Corners, state: State) -> Floats:
    """(M,) by which corners far off lose their pull."""
    miss = np.linalg.norm(residuals(corners, state), axis=1)
    weights: Floats = 1.0 / (1.0 + (miss / (DAMPED * np.median(miss) + 1e-12)) ** 2)
    return weights


def _refined(corners: Corners, state: State) -> State:
    for coefficients in (1, 1, 2, 2):
        wider = with_coefficients(state, coefficients)
        state = adjusted(corners, wider, soft_weights(corners, wider), STEPS)
    return state


def with_coefficients(state: State, count: int) -> State:
    """The same lens with room for more coefficients, or without the last."""
    lens = np.concatenate([state.lens, np.zeros(max(0, 3 + count - len(state.lens)))])[: 3 + count]
    return State(lens, state.turns, state.places)


def _with_focal(corners: Corners, size: tuple[int, int], edge_angle: float) -> State:
    centre = np.array([(size[0] - 1) / 2, (size[1] - 1) / 2])
    focal = float(np.hypot(*size)) / 2.0 / edge_angle
    offset = corners.pixels - centre
    r = np.linalg.norm(offset, axis=1)
    theta = np.minimum(r / focal, np.pi)
    across = (np.sinc(theta / np.pi) / focal)[:, None] * offset
    rays = np.concatenate([across, np.cos(theta)[:, None]], axis=1)
    return State(np.array([*centre, 1.0, focal]), *boards_from_rays(corners, rays))


def boards_from_rays(corners: Corners, rays: Floats) -> tuple[Floats, Floats]:
    """(V, 3, 3) turns and (V, 3) places of the boards, from (M, 3) unit rays to their corners."""
    size = float(np.abs(corners.board).max())
    flat = np.concatenate([corners.board[:, :2] / size, np.ones((len(rays), 1))], axis=1)
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    products = flat[:, :, None] * flat[:, None, :]
    system = corners.by_view(np.einsum("mij,mkl->mikjl", across, products).reshape(-1, 9, 9))
    _, vectors = np.linalg.eigh(system)
    h = vectors[:, :, 0].reshape(-1, 3, 3)
    ahead = corners.by_view((rays * (h[corners.view] @ flat[:, :, None])[..., 0]).sum(axis=1))
    lengths = np.linalg.norm(h[:, :, :2], axis=1).mean(axis=1)
    h = h * (np.where(ahead < 0.0, -1.0, 1.0) / lengths)[:, None, None]
    right, down = h[:, :, 0], h[:, :, 1]
    u, _, vt = np.linalg.svd(np.stack([right, down, np.cross(right, down)], axis=-1))
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
    return u @ vt, h[:, :, 2] * size
