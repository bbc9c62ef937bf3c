"""Bundle adjustment over the kept sightings: Gauss-Newton, relinearised at every step (Triggs et al. 2000).

Robust weights are those of a redescending M-estimator (Black & Rangarajan 1996). Noise that a frame's sightings share
is one nuisance of the frame. Kernels of the wander are compared by Laplace's approximation of the marginal likelihood.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np

from fwav_companion.estimation.errors import CAMERA_DELAY, HEIGHT, MOUNT, PITCH, Array, Ints, SampleNoise
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.information import WeightedSightings, normal_equations, own_inverse
from fwav_companion.estimation.measurement import Projection
from fwav_companion.estimation.problem import Problem, State
from fwav_companion.estimation.range_rows import with_readings
from fwav_companion.estimation.wander import WanderKernel

COMMON = 7  # noises that a frame's sightings share: attitude 3, stamp 1, error between knots 3
_WIDE_DISTANCE2 = 16.0  # squared distance at which a weight is a half
_DELAY_STEP_S, _TURN_STEP_RAD = 0.015, 0.3  # the projection is linear over these at least
_SINK_SHARE, _LEAST_SHARE = 0.6, 0.05
_LEAST_BRIDGE_WEIGHT = 1e-3
CLOCK_GRAIN_S = 1e-3  # autopilot stamps are whole milliseconds

Weigh = Callable[[Array, Projection, Array], Array]
"""(squared distance (N,), projection, inverse covariance (2, 2, N)) to weights (N,)."""


@dataclass(frozen=True)
class Step:
    """A Gauss-Newton step at a state, not yet limited."""

    step: Array  # (n,)
    size: float  # squared length in standard deviations
    covariance: Array  # (m, m) of shared, targets and the newest knot's error
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


def wide_weights(distance2: Array, projection: Projection, inverse: Array) -> Array:
    """Weights where nothing is known yet: Cauchy's."""
    del projection, inverse
    return 1.0 / (1.0 + distance2 / _WIDE_DISTANCE2)


def expected_weights(covariance: Array | None) -> Weigh:
    """A smooth step at four of the standard deviations that are expected by the last solve.

    covariance: (S + 3, S + 3) of the shared parameters and the error now. Without it a wrong calibration would reject
    the sightings that contradict it.
    """

    def weigh(distance2: Array, projection: Projection, inverse: Array) -> Array:
        extra: Array | float = 0.0
        if covariance is not None:
            j = np.concatenate([projection.shared, projection.point], axis=1)  # (2, S + 3, N)
            known = np.tensordot(covariance, j, (1, 1)).swapaxes(0, 1)
            extra = 0.5 * (inverse * np.einsum("ian,jan->ijn", j, known)).sum((0, 1))
        return np.asarray(1.0 / (1.0 + np.exp((0.5 * distance2 / (1.0 + extra) - 8.0).clip(-50.0, 50.0))))

    return weigh


def weigh_sightings(problem: Problem, projection: Projection, kernel: WanderKernel, weigh: Weigh) -> WeightedSightings:
    """Noise and robust weights of the sightings under a kernel."""
    noise, own = problem.error_noise(kernel), problem.s.own_noise
    g = np.empty((2, COMMON, len(problem.s)))
    g[:, :4] = common_noise(projection, problem.model.noise, own)
    g[:, 4:6] = projection.point[:, :2] * noise.level
    g[:, 6] = projection.point[:, 2] * noise.up
    inverse, _ = own_inverse(g, np.ones(len(problem.s)))
    u, v = projection.residual
    distance2 = u * u * inverse[0, 0] + 2 * u * v * inverse[0, 1] + v * v * inverse[1, 1]
    weight = weigh(distance2, projection, inverse) * projection.visible
    return WeightedSightings(g, distance2, weight)


def bridge_means(problem: Problem, projection: Projection, weighted: WeightedSightings, kernel: WanderKernel) -> Array:
    """Mean (3, N) of the error about the lines between knots, m, given each sighting's residual."""
    noise = problem.error_noise(kernel)
    inverse, _ = own_inverse(weighted.common, 1.0 / np.maximum(weighted.weight, _LEAST_BRIDGE_WEIGHT))
    seen = (inverse * projection.residual).sum(1)  # (2, N)
    variance = np.stack([noise.level, noise.level, noise.up]) ** 2
    return np.asarray(variance * (projection.point * seen[:, None]).sum(0))


def gauss_newton_step(
    problem: Problem, state: State, projection: Projection, weighted: WeightedSightings, kernel: WanderKernel,
    *, likelihood: bool = False,
) -> Step:  # fmt: skip
    """One step from `state`, with the covariance at the point that it starts from."""
    equations = with_readings(problem, state, kernel, normal_equations(problem, projection, weighted))
    precision, knots_det = problem.prior(kernel)
    deviation = problem.deviation(state)
    pulled = precision @ deviation
    information, gradient = equations.information + precision, equations.right - pulled
    # Scaled to a unit diagonal: priors of 1e-7 beside places of a kilometre would lose all digits.
    scale = 1.0 / np.sqrt(information.diagonal())
    scaled = information * scale * scale[:, None]
    n, now = problem.size, reported_unknowns(problem)
    columns = np.zeros((n, len(now) + 1))
    columns[now, np.arange(len(now))] = scale[now]
    columns[:, -1] = gradient * scale
    solved = np.linalg.solve(scaled, columns) * scale[:, None]
    step, covariance = solved[:, -1], solved[now, :-1]
    log_likelihood = log_det = 0.0
    if likelihood:
        log_det = float(np.linalg.slogdet(scaled)[1]) - 2.0 * float(np.log(scale).sum())
        misfit = equations.squares + float(deviation @ pulled) - float(gradient @ step)
        log_likelihood = -0.5 * (misfit + equations.log_determinant + knots_det + log_det)
    return Step(step, float(step @ gradient), 0.5 * (covariance + covariance.T), log_likelihood, log_det)


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
    problem: Problem, state: State, kernel: WanderKernel, weigh: Weigh, *, most: int, enough: float
) -> Generator[None, None, tuple[State, Step, WeightedSightings]]:
    """Gauss-Newton from `state`: at most `most` steps, or until a step's squared length is below `enough`.

    Yields between two halves of each step.
    """
    for _ in range(most):
        projection = problem.linearise(state, kernel)
        weighted = weigh_sightings(problem, projection, kernel, weigh)
        yield
        found = gauss_newton_step(problem, state, projection, weighted, kernel)
        problem.bridge = bridge_means(problem, projection, weighted, kernel)
        share = step_share(problem, projection, found.step)
        state = state.plus(share * found.step)
        problem.weigh_surveys(state)
        yield
        if share == 1.0 and found.size < enough:
            break
    return state, found, weighted


def likeliest_kernel(
    problem: Problem, state: State, kernel: WanderKernel, kernels: tuple[WanderKernel, ...], weigh: Weigh
) -> Generator[None, None, WanderKernel]:
    """The kernel of greatest marginal likelihood; all are compared at one linearisation, that of `kernel`.

    Yields after each kernel.
    """
    projection = problem.linearise(state, kernel)
    found = {}
    for k in kernels:
        weighted = weigh_sightings(problem, projection, k, weigh)
        found[k] = gauss_newton_step(problem, state, projection, weighted, k, likelihood=True).log_likelihood
        yield
    return max(found, key=found.__getitem__)
