"""Accuracy of a fitted lens: covariance, one sigma of its rays, the valid angle, and what the model leaves out.

The scatter of the corners counts only as far as the pictures agree with one another. A gradient of a picture's
residuals beyond what scatter allows is an error that all its corners share (a board that is not flat, blur, a
detector's bias). It inflates every sigma, as a cluster-robust covariance does (Liang & Zeger 1986), here with one
factor for all parameters. An error that all pictures share, such as a permanently bent board, shows only in part: as
residuals that no lens removes.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.bundle_adjustment import (
    camera_points,
    equations,
    jacobians,
    normal_equations,
    residuals,
)
from fwav_companion.tools.calibrate.lens_fit.reprojection import (
    RADIAL,
    U0,
    BoardCorners,
    Floats,
    LensAndPoses,
    angles_from_axis,
    project,
    radius,
    radius_slope,
    with_coefficients,
)

DIRECTIONS: Final = 16
RINGS: Final = 24
"""Number of directions and of angles from the axis at which rays are evaluated."""
MOST_DRIFT_PX: Final = 1.0
"""Largest rotation of a valid ray by one sigma of EXTRA more coefficients, in pixels on the axis. It limits the valid
range of the fit beyond the outermost corners."""
EXTRA: Final = 2
"""Number of further coefficients in the limit of the valid range. In twelve draws of a 200 degree lens with corners up
to 60 degrees, rays erred by up to 9 px at the limit by one coefficient (83 degrees), by 3 px at that by two (74)."""
WORST_RAY: Final = np.radians(1.0)
"""Largest sigma of a valid ray without the common rotation, radians: 2 % of the height above ground."""
OUTERMOST: Final = 5
"""The angle that corners reach is that of the fifth corner from outside: a single corner supports no angle."""
GRID: Final = np.radians(0.5)
"""Step of the search for the valid angle, radians."""
SINGULAR: Final = 1e-13
"""Least ratio of the eigenvalues of a matrix with rows of one size: a smaller one is rounding error."""
OUTWARDS: Final = 3.0
"""Factor of p q f in the displacement of a pixel that lies in the direction of the decentring."""


class LensAccuracy(msgspec.Struct, frozen=True, eq=False):
    """The accuracy of a fitted lens."""

    covariance: Floats
    """Covariance of u0, v0, aspect ratio, c1 .. cn, (P, P); pixels."""
    inflation: float
    """Ratio of the sigmas to those that the corners' scatter alone would give."""
    reached: float
    """Angle from the axis that corners reach, radians."""
    supported: float
    """Angle from the axis up to which the fit is valid, radians."""


class Decentring(msgspec.Struct, frozen=True):
    """Displacement by the decentring of the lens elements, which this model has no term for (Brown 1966).

        du = f (2 p1 x y + p2 (q + 2 x^2)),   dv = f (p1 (q + 2 y^2) + 2 p2 x y),   q = x^2 + y^2

    with x and y the pixel's offset from the principal point in focal lengths.
    """

    edge_px: float
    """Displacement at the angle that corners reach, in the worst direction, pixels."""
    sigma_px: float
    """One sigma of it, pixels."""


def lens_accuracy(corners: BoardCorners, state: LensAndPoses, variance: float) -> LensAccuracy:
    """The accuracy of the lens; ``variance``: of one axis of a corner. LinAlgError: the corners do not determine it."""
    inflation = cluster_inflation(corners, state, variance)
    theta = np.sort(angles_from_axis(camera_points(corners, state)))
    reached = float(theta[-min(OUTERMOST, len(theta))])
    variance *= inflation**2
    covariance = variance * inverse(_lens_information(corners, state).sum(axis=0))
    end = _extrapolation_limit(corners, state, variance, reached)
    return LensAccuracy(covariance, inflation, reached, _accurate_up_to(state.lens, covariance, reached, end))


def decentring(corners: BoardCorners, state: LensAndPoses, variance: float, reached: float) -> Decentring:
    """The decentring by one Gauss-Newton step from the fit, all other parameters free. LinAlgError: not observable."""
    residual, by_board, by_lens = jacobians(corners, state)
    wider = np.concatenate([by_lens, _decentring_jacobian(corners.pixels - residual, state.lens)], axis=-1)
    normal = equations(corners, residual, by_board=by_board, by_lens=wider, weights=np.ones(len(residual)))
    covariance = inverse(normal.lens_information().sum(axis=0))
    p = (covariance @ normal.lens_gradient.sum(axis=0))[-2:]
    focal = float(state.lens[RADIAL])
    edge = OUTWARDS * float(radius(state.lens, np.array(reached))) ** 2 / focal
    sigma = np.sqrt(variance * np.linalg.eigvalsh(covariance[-2:, -2:])[-1])
    return Decentring(edge * float(np.linalg.norm(p)), edge * float(sigma))


def cluster_inflation(corners: BoardCorners, state: LensAndPoses, variance: float) -> float:
    """The factor, at least 1, by which sigmas from the corners' scatter alone are too small.

    Its square is a ratio of sums over the views: their squared gradients, in the metric of the covariance, over the
    squares that scatter of this variance gives, less each view's own share in the answer. LinAlgError: the lens is not
    determined.
    """
    _, _, by_lens = project(state.lens, camera_points(corners, state))
    gradients = corners.by_view((np.swapaxes(by_lens, 1, 2) @ residuals(corners, state)[..., None])[..., 0])
    information = _lens_information(corners, state)
    covariance = inverse(information.sum(axis=0))
    observed = float(np.einsum("vi,ij,vj->", gradients, covariance, gradients))
    shares = covariance @ information
    own = np.einsum("vij,vji->", shares, shares)
    expected = variance * float(np.trace(shares, axis1=1, axis2=2).sum() - own)
    return float(np.sqrt(max(1.0, observed / expected))) if expected > 0.0 else 1.0


def ray_sigmas(lens: Floats, covariance: Floats, angles: Floats, widest: float) -> tuple[Floats, Floats]:
    """One sigma, (A,), of rays at ``angles`` in their worst direction, radians; and without the common rotation.

    A common rotation of all rays up to ``widest`` is part of the mount correction: a camera on a crooked mount and one
    whose principal point is off give nearly the same image.
    """
    rings = np.linspace(0.0, widest, RINGS + 1)[1:]
    by_lens, by_rotation = _by_lens(lens, rings), _by_rotation(rings)
    area = np.repeat(np.sin(rings), DIRECTIONS * 3) ** 0.5
    absorbed = np.linalg.lstsq(
        by_rotation.reshape(-1, 3) * area[:, None], by_lens.reshape(-1, len(lens)) * area[:, None]
    )[0]
    at = _by_lens(lens, angles)
    return _worst(at, covariance), _worst(at - _by_rotation(angles) @ absorbed, covariance)


def inverse(matrix: Floats) -> Floats:
    """The inverse of a positive definite matrix whose rows differ in size. LinAlgError: it is not positive definite."""
    size = np.sqrt(np.maximum(np.diagonal(matrix), 0.0))
    if not size.min() > 0.0:
        raise np.linalg.LinAlgError("a parameter has no effect on any residual")
    values, vectors = np.linalg.eigh(matrix / size[:, None] / size)
    if not values[0] > SINGULAR * values[-1]:
        raise np.linalg.LinAlgError("parameters are not separable")
    inverted: Floats = (vectors / values) @ vectors.T / size[:, None] / size
    return inverted


def _lens_information(corners: BoardCorners, state: LensAndPoses) -> Floats:
    """The information of each view on the lens, its board pose free, (V, P, P), for a variance of 1 pixel^2."""
    return normal_equations(corners, state, np.ones(len(corners.pixels))).lens_information()


def _accurate_up_to(lens: Floats, covariance: Floats, reached: float, end: float) -> float:
    """The angle up to ``end`` at which one sigma of a ray reaches WORST_RAY, radians."""
    angles = np.linspace(0.0, end, 3 * RINGS + 1)
    _, sigma = ray_sigmas(lens, covariance, angles, reached)
    beyond = np.flatnonzero(~(sigma < WORST_RAY))
    return float(angles[max(0, beyond[0] - 1)]) if len(beyond) else end


def _extrapolation_limit(corners: BoardCorners, state: LensAndPoses, variance: float, reached: float) -> float:
    """The angle at which unobserved coefficients could move a ray by MOST_DRIFT_PX, or where r' ends, radians."""
    wider = with_coefficients(state, len(state.lens) - RADIAL + EXTRA)
    grid = np.arange(0.0, np.pi, GRID)
    folds = np.flatnonzero(radius_slope(wider.lens, grid) <= 0.0)
    end = float(grid[folds[0] - 1]) if len(folds) else np.pi
    try:
        covariance = variance * inverse(_lens_information(corners, wider).sum(axis=0))
    except np.linalg.LinAlgError:
        return min(reached, end)
    beyond = grid[(grid > reached) & (grid < end)]
    if not len(beyond):
        return end
    _, drift = ray_sigmas(wider.lens, covariance, beyond, reached)
    far = np.flatnonzero(drift > MOST_DRIFT_PX / wider.lens[RADIAL])
    if not len(far):
        return end
    return float(beyond[far[0] - 1]) if far[0] else reached


def _by_lens(lens: Floats, angles: Floats) -> Floats:
    """The rotation of a given pixel's ray by each lens parameter, (A, DIRECTIONS, 3, P), radians in space."""
    phi = np.arange(DIRECTIONS) * 2.0 * np.pi / DIRECTIONS
    theta, phi = (each.ravel() for each in np.meshgrid(np.maximum(angles, 1e-6), phi, indexing="ij"))
    rays = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    _, by_point, by_parameter = project(lens, rays)
    outward = np.stack([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)], axis=1)
    around = np.stack([-np.sin(phi), np.cos(phi), 0.0 * phi], axis=1)
    tangents = np.stack([outward, around], axis=-1)
    moved: Floats = -tangents @ np.linalg.solve(by_point @ tangents, by_parameter)
    return moved.reshape(len(angles), DIRECTIONS, 3, len(lens))


def _by_rotation(angles: Floats) -> Floats:
    """The displacement of a ray by a rotation of the camera about each of its axes, (A, DIRECTIONS, 3, 3)."""
    phi = np.arange(DIRECTIONS) * 2.0 * np.pi / DIRECTIONS
    theta, phi = np.meshgrid(angles, phi, indexing="ij")
    rays = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    moved: Floats = np.swapaxes(np.cross(np.eye(3), rays[..., None, :]), -1, -2)
    return moved


def _worst(moved: Floats, covariance: Floats) -> Floats:
    """The largest sigma over the directions, (A,): the square root of the larger axis of each ray's ellipse."""
    spread = moved @ covariance @ np.swapaxes(moved, -1, -2)
    largest: Floats = np.sqrt(np.linalg.eigvalsh(spread)[..., -1].max(axis=-1))
    return largest


def _decentring_jacobian(pixels: Floats, lens: Floats) -> Floats:
    """The derivatives of pixels by p1 and p2, (M, 2, 2)."""
    focal = float(lens[RADIAL])
    x, y = ((pixels - lens[U0 : U0 + 2]) / focal).T
    q = x * x + y * y
    by_p1, by_p2 = np.stack([2.0 * x * y, q + 2.0 * y * y], axis=1), np.stack([q + 2.0 * x * x, 2.0 * x * y], axis=1)
    jacobian: Floats = focal * np.stack([by_p1, by_p2], axis=-1)
    return jacobian
