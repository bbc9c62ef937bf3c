"""The places of targets that are seen in one or several pictures. PURE, numpy.

Nonlinear least squares (Triggs et al. 2000) over the positions of the targets and the errors that pictures share, with
priors. A picture's own errors are eliminated: they are part of the covariance of its sights. One sight of one target on
the ground is the smallest case: its answer is the intersection of ray and ground.

The ground is one more measurement of each target: its height above the surface is 0 within the surface's sigma.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import hypot, sqrt
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.tools.locate.shots import (
    SHARED_COUNT,
    Budget,
    PixelPrediction,
    Place,
    Residual,
    SharedError,
    SharedEstimate,
    Shot,
    Sight,
    SightsEstimate,
)
from fwav_companion.tools.locate.sight_rows import Array, Rows, SightCamera, across_by_pixel
from fwav_companion.tools.locate.surfaces import Surface
from fwav_companion.types import NoRay, Ray

MOST_STEPS: Final = 25
NEAR_ENOUGH_M: Final = 1e-5
LEAST_TILT_SIGMAS: Final = 3.0
"""Least angle of a ray below the horizon, in sigmas of its tilt: below it the claim would reach the horizon."""
OBSERVED: Final = 0.5
"""Sigma over prior below which a shared error is reported."""
CONTRADICTION_SIGMAS: Final = 3.09
"""Normal quantile of the sum of squares beyond which the sights contradict the claim: 99.9 %."""
GROUND: Final = -1


class SightError(msgspec.Struct, frozen=True):
    """The reason why a sight gives no place."""

    sight: Sight
    reason: str
    """outside_lens, above_horizon, near_horizon, too_low, beyond_terrain, no_terrain or two_grounds."""


def locate(
    shots: Sequence[Shot],
    sights: Sequence[Sight],
    surface: Surface,
    shared_sigmas: Sequence[Sequence[float]],
    *,
    predicted: bool = False,
) -> SightsEstimate | SightError:
    """The places of all targets, in the order of their first sights.

    ``shared_sigmas``: for each group one sigma of each :class:`SharedError`. ``predicted``: also where each target
    should be in the pictures that have no sight of it.
    """
    labels = list(dict.fromkeys(sight.label for sight in sights))
    starts = _starts(shots, sights, surface, shared_sigmas, labels)
    if isinstance(starts, SightError):
        return starts
    problem = _Problem(shots, sights, surface, shared_sigmas, labels)
    problem.shape_m = starts.shape_m
    problem.solve(starts.places)
    return problem.result(shots if predicted else ())


def _starts(
    shots: Sequence[Shot],
    sights: Sequence[Sight],
    surface: Surface,
    shared_sigmas: Sequence[Sequence[float]],
    labels: Sequence[str],
) -> _Starts | SightError:
    """The first places: weighted means of the intersections of each target's rays with the ground.

    A target whose ground is ambiguous for one sight may be clear by another one.
    """
    total, weights = np.zeros((len(labels), 3)), np.zeros(len(labels))
    shape_m: list[float | SightError | None] = [None] * len(labels)
    for sight in sights:
        shot = shots[sight.shot]
        ray = shot.lens.camera_ray_from_pixel(*sight.pixel)
        if isinstance(ray, NoRay):
            return SightError(sight, ray.reason.value)
        down = np.array(shot.ned_from_camera) @ np.array(ray)
        direction: Vector3 = (float(down[0]), float(down[1]), float(down[2]))
        tilt = hypot(shot.own_attitude, shared_sigmas[shot.group][SharedError.MOUNT_X])
        if 0.0 < direction[2] < LEAST_TILT_SIGMAS * tilt:
            return SightError(sight, "near_horizon")
        point = surface.meet(shot.camera_ned, direction)
        if isinstance(point, str):
            return SightError(sight, point)
        index = labels.index(sight.label)
        weight = direction[2] ** 4
        total[index] += weight * np.array(point)
        weights[index] += weight
        here = surface.shape_sigma_m(shot.camera_ned, direction, point, tilt)
        before = shape_m[index]
        if isinstance(here, str):
            shape_m[index] = SightError(sight, here) if before is None else before
        else:
            shape_m[index] = min(here, before) if isinstance(before, float) else here
    for each in shape_m:
        if isinstance(each, SightError):
            return each
    known = tuple(each for each in shape_m if isinstance(each, float))
    return _Starts(np.asarray(total / weights[:, None]), known)


class _Starts(NamedTuple):
    places: Array
    """(targets, 3)."""
    shape_m: tuple[float, ...]
    """One sigma of the level by the shape of the ground about each target, metres."""


class _Problem:
    """Normal equations over the state: the shared errors of every group, then north, east, down of every target."""

    def __init__(
        self,
        shots: Sequence[Shot],
        sights: Sequence[Sight],
        surface: Surface,
        shared_sigmas: Sequence[Sequence[float]],
        labels: Sequence[str],
    ) -> None:
        self.labels, self.surface, self.sights = labels, surface, sights
        self.prior: Array = np.square(np.array(shared_sigmas, dtype=float)).ravel()  # (8 groups,)
        self.shared = len(self.prior)
        self.size = self.shared + 3 * len(labels)
        self.places = [self._target(index) for index in range(len(labels))]
        by_shot: dict[int, list[Sight]] = {}
        for sight in sights:
            by_shot.setdefault(sight.shot, []).append(sight)
        self.cameras = []
        for index, seen in by_shot.items():
            rays = [shots[index].lens.camera_ray_and_derivatives_from_pixel(*sight.pixel) for sight in seen]
            good = [ray for ray in rays if isinstance(ray, Ray)]
            self.cameras.append(SightCamera(shots[index], seen, good, [labels.index(sight.label) for sight in seen]))
        self.state: Array = np.zeros(self.size)
        self.cov: Array = np.zeros((self.size, self.size))
        self.cost = 0.0
        self.shape_m: Sequence[float] = [0.0] * len(labels)

    def solve(self, starts: Array) -> None:
        """Gauss-Newton steps from the first places to the least sum of squares."""
        self.state[self.shared :] = starts.ravel()
        for _ in range(MOST_STEPS):
            normal, right, self.cost = self._normal_equations()
            self.cov = np.asarray(np.linalg.inv(normal), dtype=np.float64)
            step = self.cov @ right
            self.state += step
            if np.abs(step[self.shared :]).max() < NEAR_ENOUGH_M:
                break
        *_, self.cost = self._normal_equations()

    def _target(self, index: int) -> slice:
        first = self.shared + 3 * index
        return slice(first, first + 3)

    def _normal_equations(self) -> tuple[Array, Array, float]:
        """(A^T W A, A^T W (measured - predicted), sum of squares)."""
        normal, right, cost = np.zeros((self.size, self.size)), np.zeros(self.size), 0.0
        known = self.prior > 0.0
        diagonal = np.where(known, 1.0 / np.where(known, self.prior, 1.0), 1e18)  # an exact error stays 0
        normal[range(self.shared), range(self.shared)] = diagonal
        right[: self.shared] = -diagonal * self.state[: self.shared]
        cost += float(np.sum(diagonal * self.state[: self.shared] ** 2))
        for camera in self.cameras:
            e, jacobian, covariance, _ = camera.rows(self.state, self.places)
            weight = np.linalg.inv(covariance)
            normal += jacobian.T @ weight @ jacobian
            right -= jacobian.T @ weight @ e
            cost += float(e @ weight @ e)
        for index in range(len(self.labels)):
            row = self._ground_row(index)
            if row is None:
                continue
            above, gradient, sigma = row
            at = self._target(index)
            normal[at, at] += np.outer(gradient, gradient) / sigma**2
            right[at] -= gradient * above / sigma**2
            cost += above**2 / sigma**2
        return normal, right, cost

    def _ground_row(self, index: int) -> tuple[float, Array, float] | None:
        """(height below the surface, its gradient, sigma) of a target; None outside the surface."""
        north, east, down = self.state[self._target(index)]
        level = self.surface.level(north, east)
        if level is None:
            return None
        return (
            float(down - level[0]),
            np.array([-level[1], -level[2], 1.0]),
            hypot(1e-3, self.shape_m[index], self.surface.sigma_m(self._height(index), float(north), float(east))),
        )

    def _height(self, index: int) -> float:
        """Height of the lowest camera that sees a target above it, metres."""
        down = float(self.state[self._target(index)][2])
        return min(down - float(c.centre[2]) for c in self.cameras if index in c.targets)

    def result(self, shots: Sequence[Shot] = ()) -> SightsEstimate:
        """The places, with the contradiction and its factor on all sigmas. ``shots``: those to predict pixels in."""
        freedom = 2 * len(self.sights) - 2 * len(self.labels)
        scaled, contradiction = 1.0, ""
        rows = {id(camera): camera.rows(self.state, self.places) for camera in self.cameras}
        if freedom > 0 and self.cost > _chi_square_quantile(freedom, CONTRADICTION_SIGMAS):
            scaled = sqrt(self.cost / freedom)
            worst = max(self.cameras, key=lambda c: _square(rows[id(c)]) / len(c.sights))
            contradiction = (
                f"the pictures contradict one another beyond their claimed errors (by {scaled:.1f} times); "
                f"{worst.shot.name} agrees least"
            )
        places = tuple(
            msgspec.structs.replace(
                self._place(index, rows, scaled), predictions=tuple(self._predictions(index, shots, scaled))
            )
            for index in range(len(self.labels))
        )
        return SightsEstimate(places, self._shared_estimates(), contradiction, scaled)

    def _place(self, index: int, rows: Mapping[int, Rows], scaled: float) -> Place:
        at = self._target(index)
        north, east, down = (float(x) for x in self.state[at])
        cov = self.cov[at, at] * scaled**2
        residuals = []
        for camera in self.cameras:
            e, _, covariance, _ = rows[id(camera)]
            for i, target in enumerate(camera.targets):
                if target == index:
                    part = slice(2 * i, 2 * i + 2)
                    size = sqrt(float(e[part] @ np.linalg.inv(covariance[part, part]) @ e[part]))
                    residuals.append(Residual(camera.sights[i].shot, self._pixel(camera, index), size))
        return Place(
            self.labels[index],
            (north, east, down),
            _matrix(cov),
            self._budget(index, rows, scaled),
            tuple(residuals),
            self._height(index),
        )

    def _predictions(self, index: int, shots: Sequence[Shot], scaled: float) -> Iterator[PixelPrediction]:
        """A sight without noise at the predicted pixel has the covariance of the prediction: its rows are 0 there."""
        seen = {sight.shot for sight in self.sights if sight.label == self.labels[index]}
        for number, shot in enumerate(shots):
            if number in seen:
                continue
            pixel = self._pixel(SightCamera(shot, (), (), ()), index)
            ray = None if pixel is None else shot.lens.camera_ray_and_derivatives_from_pixel(*pixel)
            if pixel is None or not isinstance(ray, Ray):
                continue
            sight = Sight(number, pixel, self.labels[index], 0.0)
            _, jacobian, own, _ = SightCamera(shot, (sight,), (ray,), (index,)).rows(self.state, self.places)
            across = jacobian @ self.cov @ jacobian.T + own  # (2, 2)
            inverse = np.linalg.inv(across_by_pixel(ray))
            cov = scaled**2 * inverse @ across @ inverse.T
            (a, b), (_, d) = cov.tolist()
            yield PixelPrediction(number, pixel, ((a, b), (b, d)))

    def _pixel(self, camera: SightCamera, index: int) -> tuple[float, float] | None:
        centre, rotation = camera.corrected(self.state)
        p = rotation.T @ (self.state[self._target(index)] - centre)
        pixel = camera.shot.lens.pixel_from_camera_point((float(p[0]), float(p[1]), float(p[2])))
        return None if isinstance(pixel, NoRay) else pixel

    def _budget(self, index: int, rows: Mapping[int, Rows], scaled: float) -> Budget:
        """Each cause's part of the covariance: gain times the cause's covariance times the gain."""
        first = self.shared + 3 * index
        gain_rows = self.cov[first : first + 2]  # (2, n)
        pixel = place = attitude = ground = 0.0
        for camera in self.cameras:
            _, jacobian, covariance, by_own = rows[id(camera)]
            gain = gain_rows @ jacobian.T @ np.linalg.inv(covariance)  # (2, 2 k)
            own = gain @ by_own
            of_place, of_turn = (
                float(np.sum(own[:, part] ** 2 * camera.own[part])) for part in (slice(3), slice(3, 6))
            )
            place, attitude = place + of_place, attitude + of_turn
            total = float(np.trace(gain @ covariance @ gain.T))
            pixel += max(0.0, total - of_place - of_turn)
        for other in range(len(self.labels)):
            row = self._ground_row(other)
            if row is not None:
                gain = gain_rows[:, self._target(other)] @ row[1] / row[2] ** 2
                ground += float(gain @ gain) * row[2] ** 2
        safe = np.where(self.prior > 0.0, self.prior, np.inf)
        shared = np.sum(gain_rows[:, : self.shared] ** 2, axis=0) / safe  # (8 groups,)
        by_error = shared.reshape(-1, SHARED_COUNT).sum(axis=0)
        position, height, mount = by_error[:2].sum(), by_error[2], by_error[3:6].sum()
        parts = (pixel, place, attitude, position, height, mount, by_error[6], by_error[7], ground, by_error[8])
        return Budget(*(scaled * sqrt(float(part)) for part in parts))

    def _shared_estimates(self) -> tuple[SharedEstimate, ...]:
        found = []
        for i in range(self.shared):
            prior, sigma = sqrt(float(self.prior[i])), sqrt(max(0.0, float(self.cov[i, i])))
            if prior > 0.0 and sigma < OBSERVED * prior:
                group, error = divmod(i, SHARED_COUNT)
                found.append(SharedEstimate(group, SharedError(error), float(self.state[i]), sigma, prior))
        return tuple(found)


def _square(rows: Rows) -> float:
    e, _, covariance, _ = rows
    return float(e @ np.linalg.inv(covariance) @ e)


def _matrix(m: Any) -> Matrix3:
    rows = [tuple(float(x) for x in row) for row in m]
    return ((*rows[0],), (*rows[1],), (*rows[2],))  # type: ignore[return-value]


def _chi_square_quantile(freedom: int, normal_quantile: float) -> float:
    """The quantile of chi-square (Wilson & Hilferty 1931), within 1 % here."""
    part = 2.0 / (9.0 * freedom)
    return float(freedom * (1.0 - part + normal_quantile * sqrt(part)) ** 3)
