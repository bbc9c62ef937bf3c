"""Bundle adjustment over the kept sightings: Gauss-Newton, relinearised at every step (Triggs et al. 2000).

Noise that a frame's sightings share is one nuisance of the frame. Kernels of the wander are compared by Laplace's
approximation of the marginal likelihood, all with the same weights of the sightings (`robust_weights`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np

from fwav_companion.estimation.errors import CAMERA_DELAY, HEIGHT, MOUNT, PITCH, Array, Ints, SampleNoise
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.information import (
    WeightedSightings,
    normal_equations,
    own_inverse,
    sighting_rows,
)
from fwav_companion.estimation.measurement import Projection
from fwav_companion.estimation.post_fit import PostFit, judge_sightings, post_fit
from fwav_companion.estimation.problem import Problem, State
from fwav_companion.estimation.range_rows import with_readings
from fwav_companion.estimation.robust_weights import HALF, expected_weights
from fwav_companion.estimation.wander import WanderKernel

COMMON = 7  # noises that a frame's sightings share: attitude 3, stamp 1, error between knots 3
_DELAY_STEP_S, _TURN_STEP_RAD = 0.015, 0.3  # the projection is linear over these at least
_SINK_SHARE, _LEAST_SHARE = 0.6, 0.05
_LEAST_BRIDGE_WEIGHT = 1e-3
CLOCK_GRAIN_S = 1e-3  # autopilot stamps are whole milliseconds

Weigh = Callable[[Array], Array]
"""Squared distances (N,) to weights (N,)."""


@dataclass(frozen=True)
class Step:
    """A Gauss-Newton step at a state, not yet limited."""

    step: Array  # (n,)
    size: float  # squared length in standard deviations
    covariance: Array  # (n, n)
    log_likelihood: float  # marginal, up to a constant that kernels share; 0 where it was not asked for
    log_determinant: float  # of the information matrix


def common_noise(projection: Projection, noise: SampleNoise, own: Array | None = None) -> Array:
    """Standard deviations (2, 4, M) that attitude's noises about three axes and the stamp's noise cause.

    own: (3, M) noise of the frames' own poses, attitude in row 0.
    """
    g = np.empty((2, 4, projection.residual.shape[1]))
    attitude = noise.attitude_rad if own is None else np.hypot(noise.attitude_rad, own[0])
    g[:, :3] = projection.shared[:, MOUNT] * attitude
    stamp2 = (noise.attitude_stamp_delay_s**2 + CLOCK_GRAIN_S**2) / 12.0 + noise.stamp_jitter_s**2
    g[:, 3] = projection.shared[:, CAMERA_DELAY] * math.sqrt(stamp2)
    return g


def sighting_noise(problem: Problem, projection: Projection, kernel: WanderKernel) -> WeightedSightings:
    """Noise of the sightings under a kernel; all that are visible weigh one."""
    noise, count = problem.error_noise(kernel), len(problem.s)
    g = np.empty((2, COMMON, count))
    g[:, :4] = common_noise(projection, problem.model.noise, problem.s.own_noise)
    g[:, 4:6] = projection.point[:, :2] * noise.level
    g[:, 6] = projection.point[:, 2] * noise.up
    inverse, _ = own_inverse(g, np.ones(count))
    u, v = projection.residual
    distance2 = u * u * inverse[0, 0] + 2 * u * v * inverse[0, 1] + v * v * inverse[1, 1]
    return WeightedSightings(g, distance2, projection.visible.astype(np.float64))


def bridge_means(
    problem: Problem, projection: Projection, weighted: WeightedSightings, kernel: WanderKernel, after: PostFit
) -> Array:
    """Mean (3, N) of the error about the lines between knots, m."""
    noise = problem.error_noise(kernel)
    inverse, _ = own_inverse(weighted.common, 1.0 / np.maximum(weighted.weight, _LEAST_BRIDGE_WEIGHT))
    seen = (inverse * after.residual).sum(1)  # (2, N)
    variance = np.stack([noise.level, noise.level, noise.up]) ** 2
    return np.asarray(variance * (projection.point * seen[:, None]).sum(0))


def gauss_newton_step(
    problem: Problem, state: State, projection: Projection, weighted: WeightedSightings, kernel: WanderKernel,
    rows: Array | None = None, *, likelihood: bool = False,
) -> Step:  # fmt: skip
    """One step from `state`, with the covariance at the point that it starts from; rows: `sighting_rows`, if known."""
    equations = with_readings(problem, state, kernel, normal_equations(problem, projection, weighted, rows))
    precision, knots_det = problem.prior(kernel)
    deviation = problem.deviation(state)
    pulled = precision @ deviation
    information, gradient = equations.information + precision, equations.right - pulled
    # Scaled to a unit diagonal: priors of 1e-7 beside places of a kilometre would lose all digits.
    scale = 1.0 / np.sqrt(information.diagonal())
    scaled = information * scale * scale[:, None]
    covariance = np.linalg.inv(scaled) * scale * scale[:, None]
    covariance = 0.5 * (covariance + covariance.T)
    step = covariance @ gradient
    log_likelihood = log_det = 0.0
    if likelihood:
        log_det = float(np.linalg.slogdet(scaled)[1]) - 2.0 * float(np.log(scale).sum())
        misfit = equations.squares + float(deviation @ pulled) - float(gradient @ step)
        log_likelihood = -0.5 * (misfit + equations.log_determinant + knots_det + log_det)
    return Step(step, float(step @ gradient), covariance, log_likelihood, log_det)


def reported_unknowns(problem: Problem) -> Ints:
    """Indices of shared, targets and the newest knot's error."""
    return np.concatenate([np.arange(problem.errors_at), np.arange(problem.size - 3, problem.size)])


def step_share(problem: Problem, projection: Projection, step: Array) -> float:
    """Share of a step that is taken: not below the ground, delay and angles not beyond where they are linear."""
    errors = step[problem.errors_at :].reshape(-1, 3)
    up = step[problem.shared_size + 2 : problem.errors_at : TARGET_SIZE]
    sink = step[HEIGHT] + problem.error_at_sightings(errors)[2] + up.take(problem.of_target)
    share = 1.0
    sinking = sink > 1e-9
    if sinking.any():
        room = _SINK_SHARE * np.maximum(projection.height[sinking], 0.05) / sink[sinking]
        share = min(share, float(np.quantile(room, 0.02)))
    turn = float(np.abs(step[1 : PITCH + 1]).max())
    share = min(share, _DELAY_STEP_S / max(1e-9, abs(step[CAMERA_DELAY])), _TURN_STEP_RAD / max(1e-9, turn))
    return float(max(share, _LEAST_SHARE))


def iterate(
    problem: Problem, state: State, kernel: WanderKernel, weigh: Weigh | None, *, most: int, enough: float
) -> Generator[None, None, tuple[State, Step, WeightedSightings]]:
    """Gauss-Newton from `state`: at most `most` steps, or until a step's squared length is below `enough`.

    weigh: weights by the distances from the state; None: each sighting is judged by all others. Yields between two
    halves of each step.
    """
    weight: Array | None = None
    for _ in range(most):
        projection = problem.linearise(state, kernel)
        rows, noise = sighting_rows(problem, projection), sighting_noise(problem, projection, kernel)
        if weigh is not None:
            weight = weigh(noise.distance2)
        elif weight is None:
            weight = judged_weights(problem, state, projection, noise, kernel, rows)
            yield
        weighted = noise._replace(weight=noise.weight * weight)
        found = gauss_newton_step(problem, state, projection, weighted, kernel, rows)
        yield
        after = post_fit(problem, rows, projection.residual, found.step, found.covariance)
        problem.bridge = bridge_means(problem, projection, weighted, kernel, after)
        share = step_share(problem, projection, found.step)
        state = state.plus(share * found.step)
        settled = problem.weigh_surveys(state, found.covariance)
        if weigh is None:
            before, weight = weight, expected_weights(judge_sightings(problem, weighted, after))
            settled &= float(np.abs(weight - before).max()) < HALF
        yield
        if settled and share == 1.0 and found.size < enough:
            break
    return state, found, weighted


def judged_weights(
    problem: Problem, state: State, projection: Projection, noise: WeightedSightings, kernel: WanderKernel, rows: Array
) -> Array:
    """Weights (N,) at a state by what all others predict, where no earlier step has weights."""
    found = gauss_newton_step(problem, state, projection, noise, kernel, rows)
    after = post_fit(problem, rows, projection.residual, found.step, found.covariance)
    return expected_weights(judge_sightings(problem, noise, after))


def likeliest_kernel(
    problem: Problem, state: State, kernel: WanderKernel, kernels: tuple[WanderKernel, ...]
) -> Generator[None, None, WanderKernel]:
    """The kernel of greatest marginal likelihood; all are compared at one linearisation, that of `kernel`.

    The sightings weigh alike under all of them, as under the quickest: else a slow kernel would reject what contradicts
    it. Yields after each kernel.
    """
    projection = problem.linearise(state, kernel)
    rows, quickest = sighting_rows(problem, projection), kernels[-1]
    noise = sighting_noise(problem, projection, quickest)
    weight = noise.weight * judged_weights(problem, state, projection, noise, quickest, rows)
    yield
    found = {}
    for k in kernels:
        weighted = sighting_noise(problem, projection, k)._replace(weight=weight)
        found[k] = gauss_newton_step(problem, state, projection, weighted, k, rows, likelihood=True).log_likelihood
        yield
    return max(found, key=found.__getitem__)
