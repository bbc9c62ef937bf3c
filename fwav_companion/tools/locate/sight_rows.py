"""A picture's sights as linear equations: residuals, and their derivatives by places and errors. PURE, numpy.

With m the measured unit ray, d the predicted one, T (2, 3) two unit vectors across m, the residual is e = T d. With X
the target, c the camera, R ned_from_camera, p = R^T (X - c), for errors that are estimate minus truth::

    d e / d X       =  T R^T / |p|          d e / d position =  T R^T / |p|
    d e / d mount   = -T [d]x               d e / d heading  =  T R^T (z x (X - c)) / |p|
    d e / d focal   = -T (dm/du (u - u0) + dm/dv (v - v0))
    d e / d delay   = (d e / d position) velocity + (d e / d mount) turn
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.tools.locate.shots import SHARED_COUNT, Shot, Sight
from fwav_companion.types import NoRay, Ray

Array: TypeAlias = NDArray[np.float64]
Rows: TypeAlias = tuple[Array, Array, Array, Array]
"""Of k sights: residuals (2 k,), Jacobian (2 k, n), covariance (2 k, 2 k), derivatives by the own errors (2 k, 6)."""


class SightCamera:
    """A picture's sights with what does not change between the steps."""

    def __init__(self, shot: Shot, sights: Sequence[Sight], rays: Sequence[Ray], targets: Sequence[int]) -> None:
        self.shot, self.sights, self.targets = shot, sights, targets
        self.centre: Array = np.array(shot.camera_ned)
        self.velocity: Array = np.array(shot.velocity_ned)
        self.turn: Array = np.array(shot.turn)
        self.rotation: Array = np.array(shot.ned_from_camera)  # (3, 3)
        self.across, self.noise, self.by_focal = [], [], []
        axis = shot.lens.pixel_from_camera_point((0.0, 0.0, 1.0))
        u0, v0 = (0.0, 0.0) if isinstance(axis, NoRay) else axis
        for sight, ray in zip(sights, rays, strict=True):
            across = _across(ray.direction)  # T, (2, 3)
            by_pixel = across_by_pixel(ray)
            self.across.append(across)
            self.noise.append(by_pixel @ by_pixel.T * sight.sigma_px**2)
            self.by_focal.append(by_pixel @ np.array([sight.pixel[0] - u0, sight.pixel[1] - v0]))
        own = shot.own_position_m, shot.own_position_m, shot.own_height_m, *(shot.own_attitude,) * 3
        self.own: Array = np.square(np.array(own))  # (6,)

    def corrected(self, state: Array) -> tuple[Array, Array]:
        """Camera position and ned_from_camera less the shared errors of a state: truth = estimate - error."""
        first = self.shot.group * SHARED_COUNT
        s = state[first : first + SHARED_COUNT]
        centre = self.centre - np.array([s[0], s[1], -s[2]]) - self.velocity * s[8]
        return centre, _turned(s[6]).T @ self.rotation @ _exp(s[3:6] + self.turn * s[8]).T

    def rows(self, state: Array, places: Sequence[slice]) -> Rows:
        """The linear equations of the k sights at a state of n numbers; ``places``: of each target in the state."""
        k, first = len(self.sights), self.shot.group * SHARED_COUNT
        focal = state[first + 7]
        centre, rotation = self.corrected(state)
        e, jacobian, by_own = np.zeros(2 * k), np.zeros((2 * k, len(state))), np.zeros((2 * k, 6))
        covariance = np.zeros((2 * k, 2 * k))
        for i, (across, noise, by_focal) in enumerate(zip(self.across, self.noise, self.by_focal, strict=True)):
            rows, apart = slice(2 * i, 2 * i + 2), state[places[self.targets[i]]] - centre
            p = rotation.T @ apart
            distance = float(np.linalg.norm(p))
            direction = p / distance
            by_place = across @ rotation.T / distance  # (2, 3)
            by_turn = -across @ _cross(direction)  # (2, 3)
            e[rows] = across @ direction - by_focal * focal
            jacobian[rows, places[self.targets[i]]] = by_place
            jacobian[rows, first : first + 3] = by_place * np.array([1.0, 1.0, -1.0])
            jacobian[rows, first + 3 : first + 6] = by_turn
            jacobian[rows, first + 6] = by_place @ np.array([-apart[1], apart[0], 0.0])
            jacobian[rows, first + 7] = -by_focal
            jacobian[rows, first + 8] = by_place @ self.velocity + by_turn @ self.turn
            by_own[rows, :3], by_own[rows, 3:] = by_place * np.array([1.0, 1.0, -1.0]), by_turn
            covariance[rows, rows] = noise
        return e, jacobian, covariance + by_own * self.own @ by_own.T, by_own


def across_by_pixel(ray: Ray) -> Array:
    """How the residual of a ray moves with its pixel: d e / d (u, v), (2, 2)."""
    return np.asarray(_across(ray.direction) @ np.array([ray.d_du, ray.d_dv]).T)


def _across(direction: Vector3) -> Array:
    """Two unit vectors across a unit vector, (2, 3)."""
    d = np.array(direction)
    least = np.eye(3)[int(np.argmin(np.abs(d)))]
    first = np.cross(d, least)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(d, first)])


def _cross(v: Array) -> Array:
    """[v]x, so that [v]x w = v x w."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _exp(v: Array) -> Array:
    """The rotation matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(v))
    if angle < 1e-12:
        return np.asarray(np.eye(3) + _cross(v))
    k = _cross(v / angle)
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k)


def _turned(heading: float) -> Array:
    return _exp(np.array([0.0, 0.0, heading]))
