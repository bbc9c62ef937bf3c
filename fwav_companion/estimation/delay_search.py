"""A bank of starts over the prior of the camera's delay (static multiple models; Magill 1965).

The delay has local optima: where a vehicle shakes periodically, a delay that is wrong by one period fits almost as well
and no local method leaves it.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.answers import CONTRADICTION_SIGMAS
from fwav_companion.estimation.errors import CAMERA_DELAY, Array
from fwav_companion.estimation.information import WeightedSightings
from fwav_companion.estimation.kept_sightings import Sightings, spread
from fwav_companion.estimation.measurement import Projection
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.problem import Model, Problem, State
from fwav_companion.estimation.robust_weights import wide_weights
from fwav_companion.estimation.smoother import gauss_newton_step, sighting_noise
from fwav_companion.estimation.wander import QUICK

START_GAP_S = 0.008  # an iteration converges from half of this
MOST_STARTS = 81  # of a prior that is absurdly wide: the gap grows instead
_PRIOR_SIGMAS = 2.5
# A delay far beyond a narrow prior must be found to be named: a wrong mode within the prior would be claimed instead.
_LEAST_REACH_S, _LEAST_REACH_SIGMAS = 0.08, 8.0
_SIGHTINGS, _SPAN_S, _KNOT_GAP_S = 150, 25.0, 3.0
_ROUNDS = 3
_NEAR_S, _NEAR_COST = 0.004, 25.0
_COST_SCALE = 12.0  # of the robust cost: squared distance at which it begins to level off
_LEAST_SIGMA_S = 0.002  # a prior below it needs no search


class DelayMode(NamedTuple):
    """A local optimum."""

    cost: float  # above the best one's; twice a negative log likelihood
    shared: Array  # (S,)
    targets: dict[int, Array]  # (3,) each


def search_delay(
    kept: Sightings, carrier: Carrier, model: Model, now: float, known: Mapping[int, Array]
) -> Generator[None, None, list[DelayMode]]:
    """Optima within a cost of 25 of the best one, best first; yields between pieces of bounded work.

    A piece is one iteration over at most 150 sightings, or half of one.
    """
    s = spread(kept, _SIGHTINGS, now - _SPAN_S)
    end = max(float(s.t[-1]), float(s.t[0]) + _KNOT_GAP_S)
    # One kernel, knots far apart and wide weights: only the delay counts here.
    problem = Problem(model, carrier, s, np.arange(float(s.t[0]) - 0.01, end + _KNOT_GAP_S + 0.1, _KNOT_GAP_S))
    starts = [_Descent(problem, start, gap, known) for start, gap in _starts(model)]
    for descent in starts:
        descent.step()
        yield
    costs = []
    for descent in starts:
        costs.append(descent.cost())
        yield
    for i in _promising(np.array(costs)):
        for _ in range(_ROUNDS - 1):
            starts[i].step()
            yield
        costs[i] = starts[i].cost()
        yield
    least = min(costs)
    modes: list[DelayMode] = []
    for i in np.argsort(costs, kind="stable").tolist():
        mode = starts[i].mode(costs[i] - least)
        near = any(abs(mode.shared[CAMERA_DELAY] - m.shared[CAMERA_DELAY]) <= _NEAR_S for m in modes)
        if mode.cost < _NEAR_COST and not near:
            modes.append(mode)
    return modes or [starts[len(starts) // 2].mode(0.0)]  # no finite cost: the prior's mean


def _promising(costs: Array) -> list[int]:
    """Starts that go on after their first iteration: each lower than its neighbours, and those near the lowest.

    A start on a slope is carried by its neighbours further down, which reach the same optimum.
    """
    padded = np.concatenate([[np.inf], costs, [np.inf]])
    valley = (costs <= padded[:-2]) & (costs <= padded[2:])
    return np.flatnonzero(valley | (costs < costs.min() + _NEAR_COST)).tolist()


def _starts(model: Model) -> list[tuple[float, float]]:
    """Delays to start from, and the gap between them, both s."""
    mean, sigma = float(model.priors.mean[CAMERA_DELAY]), float(model.priors.sigma[CAMERA_DELAY])
    if sigma <= _LEAST_SIGMA_S or model.consider:
        return [(mean, START_GAP_S)]
    reach = max(_PRIOR_SIGMAS * sigma, min(_LEAST_REACH_S, _LEAST_REACH_SIGMAS * sigma))
    half = min(int(np.ceil(reach / START_GAP_S)), MOST_STARTS // 2)
    gap = max(START_GAP_S, reach / half)
    return [(mean + i * gap, gap) for i in range(-half, half + 1)]


class _Descent:
    """A few iterations from one delay, which may move by one and a half gaps."""

    def __init__(self, problem: Problem, start: float, gap: float, known: Mapping[int, Array]) -> None:
        self._problem, self._least, self._most = problem, start - 1.5 * gap, start + 1.5 * gap
        shared = problem.model.priors.mean.copy()
        shared[CAMERA_DELAY] = start
        errors = np.zeros((len(problem.knots), 3))
        surveyed = {k: v for k, v in known.items() if problem.model.target(k).surveyed}
        self._state = State(shared, problem.first_targets(shared, errors, surveyed), errors)
        self._log_det = 0.0
        self._linearised: tuple[Projection, WeightedSightings, Array] | None = None

    def _linearise(self) -> tuple[Projection, WeightedSightings]:
        problem = self._problem
        if self._linearised is None:
            projection = problem.linearise(self._state, QUICK)
            noise = sighting_noise(problem, projection, QUICK)
            weighted = noise._replace(weight=noise.weight * wide_weights(noise.distance2))
            self._linearised = projection, weighted, problem.slope
        projection, weighted, problem.slope = self._linearised  # others have linearised the problem since
        return projection, weighted

    def step(self) -> None:
        """One iteration."""
        projection, weighted = self._linearise()
        found = gauss_newton_step(self._problem, self._state, projection, weighted, QUICK, likelihood=True)
        step, self._log_det = found.step, found.log_determinant
        delay = float(self._state.shared[CAMERA_DELAY])
        step[CAMERA_DELAY] = min(max(delay + step[CAMERA_DELAY], self._least), self._most) - delay
        self._state, self._linearised = self._state.plus(step), None

    def cost(self) -> float:
        """Twice a negative log likelihood, up to a constant.

        The delay's prior costs no more than where it is contradicted: a configuration may be wrong, and where the
        shaking is in step with the frames a wrong delay within the prior fits almost as well.
        """
        projection, weighted = self._linearise()
        deviation = self._problem.deviation(self._state)
        most = CONTRADICTION_SIGMAS * float(self._problem.model.priors.sigma[CAMERA_DELAY])
        deviation[CAMERA_DELAY] = min(max(deviation[CAMERA_DELAY], -most), most)
        distance2 = np.where(projection.visible, weighted.distance2, 1e6)
        fit = _COST_SCALE * np.log1p(distance2 / _COST_SCALE).sum()
        return float(fit + deviation @ self._problem.prior(QUICK)[0] @ deviation) + self._log_det

    def mode(self, cost: float) -> DelayMode:
        """The state reached."""
        targets = dict(zip(self._problem.ids.tolist(), self._state.targets, strict=True))
        return DelayMode(cost, self._state.shared, targets)
