"""Sights as linear equations, and their least squares. PURE, numpy.

Nonlinear least squares (Triggs et al. 2000) over the positions of the targets and the errors that pictures share, with
priors. A picture's own errors are eliminated: they are part of the covariance of its sights. The ground is one more
measurement of each target: its height above the surface is 0 within the surface's sigma.

With m the measured unit ray, d the predicted one, T (2, 3) two unit vectors across m, the residual is e = T d. With X
the target, c the camera, R ned_from_camera, p = R^T (X - c), for errors that are estimate minus truth::

    d e / d X       =  T R^T / |p|          d e / d position =  T R^T / |p|
    d e / d mount   = -T [d]x               d e / d heading  =  T R^T (z x (X - c)) / |p|
    d e / d focal   = -T (dm/du (u - u0) + dm/dv (v - v0))
    d e / d delay   = (d e / d position) velocity + (d e / d mount) turn
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, log
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.tools.locate.shots import SHARED_COUNT, Shot, Sight
from fwav_companion.tools.locate.surfaces import Surface
from fwav_companion.types import NoRay, Ray

Array: TypeAlias = NDArray[np.float64]
Rows: TypeAlias = tuple[Array, Array, Array, Array]
"""Of k sights: residuals (2 k,), Jacobian (2 k, n), covariance by the pixels (2 k, 2 k), derivatives by the own errors
(2 k, 6)."""
GroundRow: TypeAlias = tuple[float, Array, float]
"""Height below the surface, its gradient (3,), sigma."""
MOST_STEPS: Final = 25
NEAR_ENOUGH_M: Final = 1e-5


class SightCamera:
    """A picture's sights with what does not change between the steps."""

    def __init__(
        self, shot: Shot, sights: Sequence[Sight], rays: Sequence[Ray], targets: Sequence[int], scale: float = 1.0
    ) -> None:
        """``scale``: of the picture's own errors to those that are assumed."""
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
        self.scale_errors(scale)

    def scale_errors(self, scale: float) -> None:
        """Take the picture's own errors to be this many times those that are assumed."""
        shot = self.shot
        own = shot.own_position_m, shot.own_position_m, shot.own_height_m, *(shot.own_attitude,) * 3
        self.own: Array = np.square(scale * np.array(own))  # (6,)

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
        return e, jacobian, covariance, by_own

    def covariance(self, rows: Rows) -> Array:
        """Of the residuals, (2 k, 2 k): pixels and the picture's own errors."""
        _, _, of_pixels, by_own = rows
        return np.asarray(of_pixels + by_own * self.own @ by_own.T)


class SightProblem:
    """Normal equations over the state: the shared errors of every group, then north, east, down of every target."""

    def __init__(
        self,
        shots: Sequence[Shot],
        sights: Sequence[Sight],
        surface: Surface,
        shared_sigmas: Sequence[Sequence[float]],
        shape_m: Sequence[float],
    ) -> None:
        """``shape_m``: one sigma of the level by the shape of the ground about each target, metres."""
        self.sights, self.surface, self.shape_m = sights, surface, shape_m
        self.labels = list(dict.fromkeys(sight.label for sight in sights))
        self.assumed: Array = np.array(shared_sigmas, dtype=float).ravel()  # (9 groups,)
        self.shared = len(self.assumed)
        self.size = self.shared + 3 * len(self.labels)
        self.places = [self.target(index) for index in range(len(self.labels))]
        by_shot: dict[int, list[Sight]] = {}
        for sight in sights:
            by_shot.setdefault(sight.shot, []).append(sight)
        self.cameras = []
        for index, seen in by_shot.items():
            rays = [shots[index].lens.camera_ray_and_derivatives_from_pixel(*sight.pixel) for sight in seen]
            good = [ray for ray in rays if isinstance(ray, Ray)]
            targets = [self.labels.index(sight.label) for sight in seen]
            self.cameras.append(SightCamera(shots[index], seen, good, targets))
        self.state: Array = np.zeros(self.size)
        self.cov: Array = np.zeros((self.size, self.size))
        self.rows: list[Rows] = []
        self.ground_rows: list[GroundRow | None] = []
        self.scale_errors(1.0)

    def scale_errors(self, scale: float) -> None:
        """Take all errors of the poses to be this many times those that are assumed.

        Pictures that agree show that their own errors are small, never that those are which they share.
        """
        self.scale = scale
        self.prior: Array = np.square(max(1.0, scale) * self.assumed)  # (9 groups,)
        for camera in self.cameras:
            camera.scale_errors(scale)

    def solve(self) -> None:
        """Gauss-Newton steps from the state to the least sum of squares."""
        for _ in range(MOST_STEPS):
            self.linearize()
            normal, right, *_ = self._normal_equations()
            self.cov = np.asarray(np.linalg.inv(normal), dtype=np.float64)
            step = self.cov @ right
            self.state += step
            if np.abs(step[self.shared :]).max() < NEAR_ENOUGH_M:
                break
        self.linearize()

    def linearize(self) -> None:
        """Take the equations at the state."""
        self.rows = [camera.rows(self.state, self.places) for camera in self.cameras]
        self.ground_rows = [self._ground_row(index) for index in range(len(self.labels))]

    def evidence(self) -> tuple[float, float]:
        """Logarithm of the linear equations' marginal likelihood, less a constant, and their least sum of squares."""
        normal, right, cost, log_noise = self._normal_equations()
        least = cost - float(right @ np.linalg.solve(normal, right))
        return -0.5 * (least + log_noise + float(np.linalg.slogdet(normal)[1])), least

    def target(self, index: int) -> slice:
        """Where a target's place is in the state."""
        first = self.shared + 3 * index
        return slice(first, first + 3)

    def _normal_equations(self) -> tuple[Array, Array, float, float]:
        """(A^T W A, A^T W (measured - predicted), sum of squares, log det of the noise and of the prior)."""
        normal, right = np.zeros((self.size, self.size)), np.zeros(self.size)
        known = self.prior > 0.0
        safe = np.where(known, self.prior, 1e-18)  # an exact error stays 0
        normal[range(self.shared), range(self.shared)] = 1.0 / safe
        right[: self.shared] = -self.state[: self.shared] / safe
        cost = float(np.sum(self.state[: self.shared] ** 2 / safe))
        log_noise = float(np.sum(np.log(safe)))
        for camera, rows in zip(self.cameras, self.rows, strict=True):
            e, jacobian, *_ = rows
            covariance = camera.covariance(rows)
            weight = np.linalg.inv(covariance)
            normal += jacobian.T @ weight @ jacobian
            right -= jacobian.T @ weight @ e
            cost += float(e @ weight @ e)
            log_noise += float(np.linalg.slogdet(covariance)[1])
        for index, row in enumerate(self.ground_rows):
            if row is None:
                continue
            above, gradient, sigma = row
            at = self.target(index)
            normal[at, at] += np.outer(gradient, gradient) / sigma**2
            right[at] -= gradient * above / sigma**2
            cost += above**2 / sigma**2
            log_noise += 2.0 * log(sigma)
        return normal, right, cost, log_noise

    def _ground_row(self, index: int) -> GroundRow | None:
        """Of a target; None outside the surface."""
        north, east, down = self.state[self.target(index)]
        level = self.surface.level(north, east)
        if level is None:
            return None
        return (
            float(down - level[0]),
            np.array([-level[1], -level[2], 1.0]),
            hypot(1e-3, self.shape_m[index], self.surface.sigma_m(self.height_m(index), float(north), float(east))),
        )

    def height_m(self, index: int) -> float:
        """Height of the lowest camera that sees a target above it, metres."""
        down = float(self.state[self.target(index)][2])
        return min(down - float(c.centre[2]) for c in self.cameras if index in c.targets)


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
