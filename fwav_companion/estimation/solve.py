"""One solve: a pure function of what was kept at its instant, in pieces of bounded work."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass, field

import numpy as np

from fwav_companion.estimation.delay_search import DelayMode, search_delay
from fwav_companion.estimation.errors import CAMERA_DELAY, Array, Ints
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.problem import Model, Problem, State
from fwav_companion.estimation.robust_weights import wide_weights
from fwav_companion.estimation.smoother import iterate, likeliest_kernel, reported_unknowns
from fwav_companion.estimation.wander import KERNELS, SMOOTH, Wander, WanderKernel, at_times, place_knots
from fwav_companion.estimation.whole_flight import even_knots

_FIRST_ITERATIONS, _FIRST_FINE = 3, 6
# Most solves end after one or two. Near the ground the picture's scale depends on the height: two would leave it three
# sigmas from the optimum.
_ITERATIONS = 4
_ENOUGH = 0.5  # squared length of a step, in standard deviations, that ends the iterations
_FAR_S, _FAR_SIGMAS = 0.006, 3.0  # a delay found by a search that is further away restarts the estimate


@dataclass(frozen=True)
class Estimate:
    """What a solve found, and the next one starts from."""

    t: float  # s
    shared: Array  # (S,)
    targets: dict[int, Array]  # (3,) each, of all that were ever solved
    knots: Array  # (K,)
    errors: Array  # (K, 3)
    kernel: WanderKernel
    ids: Ints = field(default_factory=lambda: np.zeros(0, np.int64))  # (T,) of this solve, best seen first
    mean: Array = field(default_factory=lambda: np.zeros(0))  # (m,) shared, targets by `ids`, error now
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))  # (m, m)
    delay_sigma_s: float | None = None  # s, of the camera's delay as the sightings show it; None: before a solve
    wanders: tuple[Wander, Wander] | None = None
    weight: float = 1.0  # mean robust weight of the newest sightings
    weights: Mapping[int, float] = field(default_factory=dict)  # mean robust weight of each target's sightings
    modes: tuple[DelayMode, ...] = ()
    surveys: Mapping[int, float] = field(default_factory=dict)  # robust weight of each landmark's survey

    @property
    def is_finite(self) -> bool:
        """Whether all values are numbers."""
        return all(bool(np.isfinite(a).all()) for a in (self.shared, self.errors, self.mean, self.covariance))


@dataclass(frozen=True)
class SolveTask:
    """The input of a solve: a snapshot that the estimator no longer changes."""

    t: float
    model: Model
    carrier: Carrier
    kept: Sightings
    last: Estimate
    search: bool
    compare_kernels: bool
    whole_flight: bool = False  # all of the flight counts alike, not its end most

    def run(self) -> Estimate:
        """The whole solve in line."""
        pieces = self.slices()
        while True:
            try:
                next(pieces)
            except StopIteration as done:
                estimate: Estimate = done.value
                return estimate

    def slices(self) -> Generator[None, None, Estimate]:
        """The solve in pieces: an iteration of the delay search, a kernel, or a Gauss-Newton step each."""
        start, modes = self.last, self.last.modes
        if self.search:
            found = yield from search_delay(self.kept, self.carrier, self.model, self.t, start.targets)
            modes, best = tuple(found), found[0]
            if self._is_far(best):
                kept = {k: v for k, v in start.targets.items() if k not in best.targets}
                start = Estimate(self.t, best.shared, kept | best.targets, np.zeros(0), np.zeros((0, 3)), start.kernel)
        knots = self._knots()
        problem = Problem(self.model, self.carrier, self.kept, knots)
        errors = at_times(knots, start.knots, start.errors)
        state = State(start.shared, problem.first_targets(start.shared, errors, start.targets), errors)
        kernel, first = start.kernel, start.delay_sigma_s is None
        if first:
            state, _, _ = yield from iterate(
                problem, state, kernel, wide_weights, most=_FIRST_ITERATIONS, enough=_ENOUGH
            )
        if self.compare_kernels:
            kernel = yield from likeliest_kernel(problem, state, kernel, self.kernels)
        most = _FIRST_FINE if first or self.whole_flight else _ITERATIONS
        state, step, weighted = yield from iterate(problem, state, kernel, None, most=most, enough=_ENOUGH)
        order, few = _best_seen_first(problem), np.arange(problem.shared_size)
        now = reported_unknowns(problem)
        rows = problem.shared_size + TARGET_SIZE * order[:, None] + np.arange(TARGET_SIZE)
        end = np.arange(problem.errors_at, problem.errors_at + 3)
        index = np.concatenate([few, rows.ravel(), end])
        mean = np.concatenate([state.shared, state.targets.ravel(), state.errors[-1]])
        covariance = step.covariance[now[:, None], now]
        delay_sigma_s = float(covariance[CAMERA_DELAY, CAMERA_DELAY]) ** 0.5
        if self.model.consider:
            mean, covariance = self._considered(mean, covariance)
        count = np.bincount(problem.of_target, minlength=len(problem.ids))
        weights = np.bincount(problem.of_target, weighted.weight, len(problem.ids)) / np.maximum(count, 1)
        ids = problem.ids.tolist()
        return Estimate(
            self.t, state.shared, start.targets | dict(zip(ids, state.targets, strict=True)), knots, state.errors,
            kernel, problem.ids[order], mean[index], covariance[np.ix_(index, index)],
            delay_sigma_s, problem.wanders(kernel), float(weighted.weight.mean()),
            dict(zip(ids, weights.tolist(), strict=True)), modes, problem.surveys(),
        )  # fmt: skip

    def _considered(self, mean: Array, covariance: Array) -> tuple[Array, Array]:
        """Mean (m,) and covariance (m, m) with the shared parameters considered (Schmidt 1966), at their priors.

        Places and errors keep their marginal estimates, for which the parameters' effect is noise that all sightings
        have in common: held in the solve as well, the position's error would absorb it (a target was 1.2 m off). An
        estimate's error is independent of what the sightings show of the parameters, so its covariance with them stays
        that of the joint estimate, while they are off by their whole priors.
        """
        priors, mean, covariance = self.model.priors, mean.copy(), covariance.copy()
        mean[: len(priors)] = priors.mean
        covariance[: len(priors), : len(priors)] = np.diag(priors.sigma**2)
        return mean, covariance

    def _knots(self) -> Array:
        breaks = self.carrier.path.breaks
        if self.whole_flight:
            return even_knots(self.kept.t, self.t, [x for b in breaks for x in (b.before, b.after)])
        return place_knots(self.kept.t, self.t, breaks)

    @property
    def kernels(self) -> tuple[WanderKernel, ...]:
        """Kernels that are compared: one where positions do not wander."""
        return KERNELS if self.model.noise.position_wander_m > 0 else (SMOOTH,)

    def _is_far(self, best: DelayMode) -> bool:
        if self.last.delay_sigma_s is None:
            return True
        far = max(_FAR_S, _FAR_SIGMAS * self.last.delay_sigma_s)
        return abs(float(best.shared[CAMERA_DELAY]) - float(self.last.shared[CAMERA_DELAY])) > far


def _best_seen_first(problem: Problem) -> Ints:
    """Indices (T,) of the targets by their number of kept sightings, then by their number."""
    count = np.bincount(problem.of_target, minlength=len(problem.ids))
    return np.argsort(-count, kind="stable").astype(np.int64)
