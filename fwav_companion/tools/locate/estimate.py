"""The places of targets that are seen in one or several pictures. PURE, numpy.

One sight of one target on the ground is the smallest case: its answer is the intersection of ray and ground.

The assumed sigmas of the poses are root mean squares over flights. The scale of this flight's errors to them is one
more unknown, common to all errors of its poses: its posterior is by the marginal likelihood of the sights (Rasmussen &
Williams, ch. 5) over a bank of scales, and the answer is that at its root mean square. A single picture has the scale
of the prior, many follow the sights; where the sights are too few to show it, the answer says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import exp, hypot, log, sqrt
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
from fwav_companion.tools.locate.sight_equations import Array, Rows, SightCamera, SightProblem, across_by_pixel
from fwav_companion.tools.locate.surfaces import Surface
from fwav_companion.types import NoRay, Ray

LEAST_TILT_SIGMAS: Final = 3.0
"""Least angle of a ray below the horizon, in sigmas of its tilt: below it the claim would reach the horizon."""
OBSERVED: Final = 0.5
"""Sigma over prior below which a shared error is reported, and above which the scale of the errors is not shown."""
CONTRADICTION_SIGMAS: Final = 3.09
"""Normal quantile of the sum of squares beyond which the sights contradict the claim: 99.9 %."""
SCALE_SIGMA: Final = log(2.0) / 1.959964
"""One sigma of the logarithm of the errors' scale: half to twice its median in 95 % of the flights."""
SCALE_MEAN: Final = -(SCALE_SIGMA**2)
"""Of the logarithm: the scale's root mean square is 1, so that one picture's claim is that of the assumed errors."""
SCALE_STEP: Final = log(2.0) / 4.0
"""Between the logarithms of the bank's scales: half of the prior's sigma."""
LEAST_LOG_WEIGHT: Final = -6.0
"""Logarithm of a scale's weight to the best one's, at which the bank ends."""
MOST_SCALES: Final = 60
"""Steps from 1 up, to 2**15: a click on another thing, seen by exact poses."""
WIDER: Final = 1.05
"""Scale above which the ellipse is wider than by the assumed errors. Poses that are given as exact stay so."""


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
    problem = SightProblem(shots, sights, surface, shared_sigmas, starts.shape_m)
    problem.state[problem.shared :] = starts.places.ravel()
    problem.solve()
    scale, contradicts = _error_scale(problem)
    problem.scale_errors(scale.rms)
    problem.solve()
    return _Answers(problem).estimate(shots if predicted else (), scale, contradicts)


class _ErrorScale(NamedTuple):
    """The posterior of the errors' scale to the assumed ones."""

    rms: float
    sigma: float
    """One sigma of its logarithm."""


def _error_scale(problem: SightProblem) -> tuple[_ErrorScale, bool]:
    """The scale of the errors by its log-normal prior and the sights, and whether the sights contradict scale 1.

    The problem is linear about its solution at scale 1 for all scales of the bank.
    """
    freedom = 2 * len(problem.sights) - 2 * len(problem.labels)
    log_evidence, cost = problem.evidence()
    weights = {0.0: log_evidence - 0.5 * (SCALE_MEAN / SCALE_SIGMA) ** 2}
    for way in (SCALE_STEP, -SCALE_STEP):
        for step in range(1, MOST_SCALES + 1):
            logarithm = way * step
            problem.scale_errors(exp(logarithm))
            weights[logarithm] = problem.evidence()[0] - 0.5 * ((logarithm - SCALE_MEAN) / SCALE_SIGMA) ** 2
            if weights[logarithm] < max(weights.values()) + LEAST_LOG_WEIGHT:
                break
    logarithms = np.array(list(weights))
    parts = np.exp(np.array(list(weights.values())) - max(weights.values()))
    parts /= parts.sum()
    variance = float(parts @ logarithms**2 - (parts @ logarithms) ** 2)
    scale = _ErrorScale(sqrt(float(parts @ np.exp(2.0 * logarithms))), sqrt(variance))
    return scale, freedom > 0 and cost > _chi_square_quantile(freedom, CONTRADICTION_SIGMAS)


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


class _Answers:
    """What a solved problem says about places, errors and pictures."""

    def __init__(self, problem: SightProblem) -> None:
        self.problem = problem
        self.seen = list(zip(problem.cameras, problem.rows, strict=True))

    def estimate(self, shots: Sequence[Shot], scale: _ErrorScale, contradicts: bool) -> SightsEstimate:
        """All places; ``shots``: those to predict pixels in."""
        contradiction = unverified = ""
        if contradicts:
            widened = f"the ellipse is widened: the poses' errors are {scale.rms:.1f} times the assumed ones"
            worst, _ = max(self.seen, key=lambda each: _square(*each) / len(each[0].sights))
            contradiction = (
                f"the pictures contradict one another beyond their claimed errors; {worst.shot.name} agrees least; "
                + (widened if scale.rms > WIDER else "the ellipse does not hold that")
            )
        elif scale.sigma > OBSERVED * SCALE_SIGMA:
            unverified = _unverified(len(self.problem.cameras))
        places = tuple(
            self._place(index, tuple(self._predictions(index, shots))) for index in range(len(self.problem.labels))
        )
        return SightsEstimate(places, self._shared_estimates(), contradiction, unverified, scale.rms)

    def _place(self, index: int, predictions: tuple[PixelPrediction, ...]) -> Place:
        problem = self.problem
        at = problem.target(index)
        north, east, down = (float(x) for x in problem.state[at])
        residuals = []
        for camera, rows in self.seen:
            e, covariance = rows[0], camera.covariance(rows)
            for i, target in enumerate(camera.targets):
                if target == index:
                    part = slice(2 * i, 2 * i + 2)
                    size = sqrt(float(e[part] @ np.linalg.inv(covariance[part, part]) @ e[part]))
                    residuals.append(Residual(camera.sights[i].shot, self._pixel(camera, index), size))
        return Place(
            problem.labels[index],
            (north, east, down),
            _matrix(problem.cov[at, at]),
            self._budget(index),
            tuple(residuals),
            problem.height_m(index),
            predictions,
        )

    def _predictions(self, index: int, shots: Sequence[Shot]) -> Iterator[PixelPrediction]:
        """A sight without noise at the predicted pixel has the covariance of the prediction: its rows are 0 there."""
        problem = self.problem
        seen = {sight.shot for sight in problem.sights if sight.label == problem.labels[index]}
        for number, shot in enumerate(shots):
            if number in seen:
                continue
            pixel = self._pixel(SightCamera(shot, (), (), ()), index)
            ray = None if pixel is None else shot.lens.camera_ray_and_derivatives_from_pixel(*pixel)
            if pixel is None or not isinstance(ray, Ray):
                continue
            sight = Sight(number, pixel, problem.labels[index], 0.0)
            camera = SightCamera(shot, (sight,), (ray,), (index,), problem.scale)
            rows = camera.rows(problem.state, problem.places)
            across = rows[1] @ problem.cov @ rows[1].T + camera.covariance(rows)  # (2, 2)
            inverse = np.linalg.inv(across_by_pixel(ray))
            cov = inverse @ across @ inverse.T
            (a, b), (_, d) = cov.tolist()
            yield PixelPrediction(number, pixel, ((a, b), (b, d)))

    def _pixel(self, camera: SightCamera, index: int) -> tuple[float, float] | None:
        centre, rotation = camera.corrected(self.problem.state)
        p = rotation.T @ (self.problem.state[self.problem.target(index)] - centre)
        pixel = camera.shot.lens.pixel_from_camera_point((float(p[0]), float(p[1]), float(p[2])))
        return None if isinstance(pixel, NoRay) else pixel

    def _budget(self, index: int) -> Budget:
        """Each cause's part of the covariance: gain times the cause's covariance times the gain."""
        problem = self.problem
        first = problem.target(index).start
        gain_rows = problem.cov[first : first + 2]  # (2, n)
        pixel = place = attitude = ground = 0.0
        for camera, rows in self.seen:
            _, jacobian, _, by_own = rows
            covariance = camera.covariance(rows)
            gain = gain_rows @ jacobian.T @ np.linalg.inv(covariance)  # (2, 2 k)
            own = gain @ by_own
            of_place, of_turn = (
                float(np.sum(own[:, part] ** 2 * camera.own[part])) for part in (slice(3), slice(3, 6))
            )
            place, attitude = place + of_place, attitude + of_turn
            total = float(np.trace(gain @ covariance @ gain.T))
            pixel += max(0.0, total - of_place - of_turn)
        for other, row in enumerate(problem.ground_rows):
            if row is not None:
                gain = gain_rows[:, problem.target(other)] @ row[1] / row[2] ** 2
                ground += float(gain @ gain) * row[2] ** 2
        safe = np.where(problem.prior > 0.0, problem.prior, np.inf)
        shared = np.sum(gain_rows[:, : problem.shared] ** 2, axis=0) / safe  # (8 groups,)
        by_error = shared.reshape(-1, SHARED_COUNT).sum(axis=0)
        position, height, mount = by_error[:2].sum(), by_error[2], by_error[3:6].sum()
        parts = (pixel, place, attitude, position, height, mount, by_error[6], by_error[7], ground, by_error[8])
        return Budget(*(sqrt(float(part)) for part in parts))

    def _shared_estimates(self) -> tuple[SharedEstimate, ...]:
        problem, found = self.problem, []
        for i, assumed in enumerate(map(float, problem.assumed)):
            sigma = sqrt(max(0.0, float(problem.cov[i, i])))
            if assumed > 0.0 and sigma < OBSERVED * assumed:
                group, error = divmod(i, SHARED_COUNT)
                found.append(SharedEstimate(group, SharedError(error), float(problem.state[i]), sigma, assumed))
        return tuple(found)


def _unverified(pictures: int) -> str:
    who = "1 picture cannot show whether its" if pictures == 1 else f"{pictures} pictures cannot show whether their"
    return (
        f"{who} errors are larger than assumed: if they are twice those, the ellipse is up to twice as large; "
        "more pictures from other sides would show it"
    )


def _square(camera: SightCamera, rows: Rows) -> float:
    return float(rows[0] @ np.linalg.inv(camera.covariance(rows)) @ rows[0])


def _matrix(m: Any) -> Matrix3:
    rows = [tuple(float(x) for x in row) for row in m]
    return ((*rows[0],), (*rows[1],), (*rows[2],))  # type: ignore[return-value]


def _chi_square_quantile(freedom: int, normal_quantile: float) -> float:
    """The quantile of chi-square (Wilson & Hilferty 1931), within 1 % here."""
    part = 2.0 / (9.0 * freedom)
    return float(freedom * (1.0 - part + normal_quantile * sqrt(part)) ** 3)
