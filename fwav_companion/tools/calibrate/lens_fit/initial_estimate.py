"""The start of the adjustment: board poses in closed form for several equidistant lenses, and the best of them.

For a known lens, a flat board's pose follows from its rays alone: d x H (x, y, 1) = 0 is linear in the nine elements
of H = [r1 r2 t]. This is Zhang's plane homography (Zhang 2000), on rays in place of pixels, so that it holds beyond 90
degrees too. The lens is r = f theta about the image's centre, for twelve values of f.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from fwav_companion.tools.calibrate.lens_fit.bundle_adjustment import adjusted, residuals
from fwav_companion.tools.calibrate.lens_fit.reprojection import BoardCorners, Floats, LensAndPoses, with_coefficients

EDGE_ANGLES: Final = np.radians([4.0, 6.0, 9.0, 13.0, 19.0, 28.0, 40.0, 55.0, 75.0, 100.0, 130.0, 170.0])
"""Angles from the axis to the image's corner, one a trial lens; each is half as large again as the one before."""
REFINED_TRIALS: Final = 4
STEPS: Final = 12
"""Adjustment steps of a refined trial: enough to see which lens is right."""
ROBUST_SCALE: Final = 4.0
"""Scale of the Cauchy weight function, in median residuals."""


def initial_estimate(corners: BoardCorners, image_size: tuple[int, int]) -> LensAndPoses:
    """The trial lens with the smallest median residual, with its board poses; ``image_size``: width, height."""
    trials = [_with_edge_angle(corners, image_size, angle) for angle in EDGE_ANGLES]
    trials.sort(key=lambda state: _median_residual(corners, state))
    refined = [_refine_state(corners, state) for state in trials[:REFINED_TRIALS]]
    return min(refined, key=lambda state: _median_residual(corners, state))


def robust_weights(corners: BoardCorners, state: LensAndPoses) -> Floats:
    """Cauchy weights (M,): a corner with a large residual loses its influence."""
    miss = np.linalg.norm(residuals(corners, state), axis=1)
    weights: Floats = 1.0 / (1.0 + (miss / (ROBUST_SCALE * np.median(miss) + 1e-12)) ** 2)
    return weights


def _median_residual(corners: BoardCorners, state: LensAndPoses) -> float:
    """The median length of a residual, pixels; infinite where a residual is not finite."""
    miss = float(np.median(np.linalg.norm(residuals(corners, state), axis=1)))
    return miss if np.isfinite(miss) else np.inf


def _refine_state(corners: BoardCorners, state: LensAndPoses) -> LensAndPoses:
    for coefficients in (1, 1, 2, 2):
        wider = with_coefficients(state, coefficients)
        state = adjusted(corners, wider, robust_weights(corners, wider), STEPS)
    return state


def _with_edge_angle(corners: BoardCorners, image_size: tuple[int, int], edge_angle: float) -> LensAndPoses:
    """The equidistant lens that sees ``edge_angle`` at the image's corner, with the board poses of its rays."""
    centre = np.array([(image_size[0] - 1) / 2, (image_size[1] - 1) / 2])
    focal = float(np.hypot(*image_size)) / 2.0 / edge_angle
    offset = corners.pixels - centre
    r = np.linalg.norm(offset, axis=1)
    theta = np.minimum(r / focal, np.pi)
    across = (np.sinc(theta / np.pi) / focal)[:, None] * offset
    rays = np.concatenate([across, np.cos(theta)[:, None]], axis=1)
    return LensAndPoses(np.array([*centre, 1.0, focal]), *_poses_from_rays(corners, rays))


def _poses_from_rays(corners: BoardCorners, rays: Floats) -> tuple[Floats, Floats]:
    """Rotations, (V, 3, 3), and positions, (V, 3), of the boards, from (M, 3) unit rays to their corners."""
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
