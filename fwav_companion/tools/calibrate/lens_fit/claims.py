"""How sure the fit is: of its numbers, of the rays that it gives, and up to which angle."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.calibrate.lens_fit.adjustment import camera_points
from fwav_companion.tools.calibrate.lens_fit.choice import Chosen
from fwav_companion.tools.calibrate.lens_fit.corners import Corners, Floats, State
from fwav_companion.tools.calibrate.lens_fit.information import inverse, told_of_lens, widening
from fwav_companion.tools.calibrate.lens_fit.projection import RADIAL, angles_from_axis, project, slope
from fwav_companion.tools.calibrate.lens_fit.starting import with_coefficients

DIRECTIONS: Final = 16
RINGS: Final = 24
"""Rays about the axis at which the claim is worked out, by direction and by angle."""
MOST_DRIFT_PX: Final = 1.0
"""The fit is believed beyond its outermost corners as far as EXTRA coefficients more, one sigma of them, would not turn
a ray by what this is on the axis."""
EXTRA: Final = 2
"""A 200 degree lens, shown up to 60 degrees, in twelve draws: at the limit that one more coefficient gives (83 degrees)
its rays erred by up to 9 px, at that of two (74 degrees) by 3."""
WORST_RAY: Final = np.radians(1.0)
"""One sigma of a ray, a common turn aside: 2 % of the height above ground, and what is worse is no calibration."""
OUTERMOST: Final = 5
"""The angle that corners reach is that of the fifth from outside: one alone is no support."""
GRID: Final = np.radians(0.5)
"""Between the angles at which it is asked how far the fit is believed: finer would only cost time."""


class Claim(msgspec.Struct, frozen=True, eq=False):
    """What is known of a fitted lens."""

    covariance: Floats
    """(P, P) of u0, v0, the stretch, c1 .. cn; pixels."""
    disagreement: float
    """How many times wider the claim is than the corners' own scatter alone would make it."""
    reached: float
    """The angle from the axis that corners reach, radians."""
    supported: float
    """The angle up to which the fit is believed, radians."""


def claim(corners: Corners, fit: Chosen) -> Claim:
    """LinAlgError where the corners leave the lens undetermined."""
    told = told_of_lens(corners, fit.state)
    disagreement = widening(corners, fit.state, fit.variance)
    theta = np.sort(angles_from_axis(camera_points(corners, fit.state)))
    reached = float(theta[-min(OUTERMOST, len(theta))])
    variance = fit.variance * disagreement**2
    covariance = variance * inverse(told.sum(axis=0))
    supported = _sure(fit.state.lens, covariance, reached, _supported(corners, fit.state, variance, reached))
    return Claim(covariance, disagreement, reached, supported)


def ray_sigmas(lens: Floats, covariance: Floats, angles: Floats, widest: float) -> tuple[Floats, Floats]:
    """(A,) one sigma of rays at ``angles``, radians, in their worst direction; (A,) the same but for a common turn.

    A turn of all rays alike, up to ``widest``, is what a mount's calibration takes up: a camera on a crooked mount and
    one whose principal point is off see nearly the same.
    """
    rings = np.linspace(0.0, widest, RINGS + 1)[1:]
    common, turns = _by_lens(lens, rings), _by_turn(rings)
    area = np.repeat(np.sin(rings), DIRECTIONS * 3) ** 0.5
    absorbed = np.linalg.lstsq(turns.reshape(-1, 3) * area[:, None], common.reshape(-1, len(lens)) * area[:, None])[0]
    at = _by_lens(lens, angles)
    return _worst(at, covariance), _worst(at - _by_turn(angles) @ absorbed, covariance)


def _sure(lens: Floats, covariance: Floats, reached: float, end: float) -> float:
    """The angle up to ``end`` where rays begin to be as unsure as WORST_RAY."""
    angles = np.linspace(0.0, end, 3 * RINGS + 1)
    _, beside = ray_sigmas(lens, covariance, angles, reached)
    unsure = np.flatnonzero(~(beside < WORST_RAY))
    return float(angles[max(0, unsure[0] - 1)]) if len(unsure) else end


def _supported(corners: Corners, state: State, variance: float, reached: float) -> float:
    """Where coefficients that nothing demands could move a ray by MOST_DRIFT_PX; at most where r' ends."""
    wider = with_coefficients(state, len(state.lens) - RADIAL + EXTRA)
    grid = np.arange(0.0, np.pi, GRID)
    folds = np.flatnonzero(slope(wider.lens, grid) <= 0.0)
    end = grid[folds[0] - 1] if len(folds) else np.pi
    try:
        covariance = variance * inverse(told_of_lens(corners, wider).sum(axis=0))
    except np.linalg.LinAlgError:
        return min(reached, float(end))
    beyond = grid[(grid > reached) & (grid < end)]
    if not len(beyond):
        return float(end)
    _, drift = ray_sigmas(wider.lens, covariance, beyond, reached)
    far = np.flatnonzero(drift > MOST_DRIFT_PX / wider.lens[RADIAL])
    if not len(far):
        return float(end)
    return float(beyond[far[0] - 1]) if far[0] else reached


def _by_lens(lens: Floats, angles: Floats) -> Floats:
    """(A, DIRECTIONS, 3, P) by which a ray of a given pixel turns, radians in space, with each number of the lens."""
    phi = np.arange(DIRECTIONS) * 2.0 * np.pi / DIRECTIONS
    theta, phi = (each.ravel() for each in np.meshgrid(np.maximum(angles, 1e-6), phi, indexing="ij"))
    rays = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    _, by_point, by_number = project(lens, rays)
    outward = np.stack([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)], axis=1)
    around = np.stack([-np.sin(phi), np.cos(phi), 0.0 * phi], axis=1)
    tangents = np.stack([outward, around], axis=-1)
    moved = -tangents @ np.linalg.solve(by_point @ tangents, by_number)
    turned: Floats = moved.reshape(len(angles), DIRECTIONS, 3, len(lens))
    return turned


def _by_turn(angles: Floats) -> Floats:
    """(A, DIRECTIONS, 3, 3) by which a ray moves with a turn of the camera about its axes."""
    phi = np.arange(DIRECTIONS) * 2.0 * np.pi / DIRECTIONS
    theta, phi = np.meshgrid(angles, phi, indexing="ij")
    rays = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    moved: Floats = np.swapaxes(np.cross(np.eye(3), rays[..., None, :]), -1, -2)
    return moved


def _worst(moved: Floats, covariance: Floats) -> Floats:
    """(A,) the largest sigma of any direction: the root of the larger axis of each ray's ellipse."""
    spread = moved @ covariance @ np.swapaxes(moved, -1, -2)
    largest: Floats = np.sqrt(np.linalg.eigvalsh(spread)[..., -1].max(axis=-1))
    return largest
