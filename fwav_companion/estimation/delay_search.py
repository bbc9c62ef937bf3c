"""A bank of starts over the prior of the camera's delay (static multiple models; Magill 1965).

The delay has local optima: where a vehicle shakes periodically, a delay that is wrong by one period fits almost as well
and no local method leaves it.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.errors import CAMERA_DELAY, Array
from fwav_companion.estimation.kept_sightings import Sightings, spread
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.problem import Model, Problem, State
from fwav_companion.estimation.smoother import gauss_newton_step, weigh_sightings, wide_weights
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

    A piece is one iteration over at most 150 sightings.
    """
    s = spread(kept, _SIGHTINGS, now - _SPAN_S)
    end = max(float(s.t[-1]), float(s.t[0]) + _KNOT_GAP_S)
    # One kernel, knots far apart and wide weights: only the delay counts here.
    problem = Problem(model, carrier, s, np.arange(float(s.t[0]) - 0.01, end + _KNOT_GAP_S + 0.1, _KNOT_GAP_S))
    found: list[DelayMode] = []
    for start, gap in _starts(model):
        found.append((yield from _descend(problem, start, gap, known)))
    found.sort(key=lambda mode: mode.cost)
    modes: list[DelayMode] = []
    for mode in found:
        near = any(abs(mode.shared[CAMERA_DELAY] - m.shared[CAMERA_DELAY]) <= _NEAR_S for m in modes)
        if mode.cost - found[0].cost < _NEAR_COST and not near:
            modes.append(mode._replace(cost=mode.cost - found[0].cost))
    return modes


def _starts(model: Model) -> list[tuple[float, float]]:
    """Delays to start from, and the gap between them, both s."""
    mean, sigma = float(model.priors.mean[CAMERA_DELAY]), float(model.priors.sigma[CAMERA_DELAY])
    if sigma <= _LEAST_SIGMA_S or model.consider:
        return [(mean, START_GAP_S)]
    reach = max(_PRIOR_SIGMAS * sigma, min(_LEAST_REACH_S, _LEAST_REACH_SIGMAS * sigma))
    half = min(int(np.ceil(reach / START_GAP_S)), MOST_STARTS // 2)
    gap = max(START_GAP_S, reach / half)
    return [(mean + i * gap, gap) for i in range(-half, half + 1)]


def _descend(
    problem: Problem, start: float, gap: float, known: Mapping[int, Array]
) -> Generator[None, None, DelayMode]:
    """A few iterations from one delay, which may move by one and a half gaps."""
    shared = problem.model.priors.mean.copy()
    shared[CAMERA_DELAY] = start
    errors = np.zeros((len(problem.knots), 3))
    surveyed = {k: v for k, v in known.items() if problem.model.target(k).surveyed}
    state = State(shared, problem.first_targets(shared, errors, surveyed), errors)
    log_det = 0.0
    for _ in range(_ROUNDS):
        projection = problem.linearise(state, QUICK)
        weighted = weigh_sightings(problem, projection, QUICK, wide_weights)
        found = gauss_newton_step(problem, state, projection, weighted, QUICK, likelihood=True)
        step, log_det = found.step, found.log_determinant
        delay = float(state.shared[CAMERA_DELAY])
        step[CAMERA_DELAY] = min(max(delay + step[CAMERA_DELAY], start - 1.5 * gap), start + 1.5 * gap) - delay
        state = state.plus(step)
        yield
    projection = problem.linearise(state, QUICK)
    weighted = weigh_sightings(problem, projection, QUICK, wide_weights)
    deviation = problem.deviation(state)
    distance2 = np.where(projection.visible, weighted.distance2, 1e6)
    cost = _COST_SCALE * np.log1p(distance2 / _COST_SCALE).sum() + deviation @ problem.prior(QUICK)[0] @ deviation
    targets = dict(zip(problem.ids.tolist(), state.targets, strict=True))
    return DelayMode(float(cost) + log_det, state.shared, targets)
