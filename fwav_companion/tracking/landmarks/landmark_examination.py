"""Examination of landmarks that disagree: each is compared with the state without its survey.

A landmark that all else contradicts is left out. Where landmarks contradict one another and the flight does not show
which is wrong, all stay in use and are named together. The covariance of each target is then widened by the movement of
its place without each of them: the solution separation of Brown and McBurney (Navigation 35, 1988).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import TypeVar

import numpy as np
from msgspec.structs import replace

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.tracking.landmarks.joint_place import UNKNOWN_M, Correction
from fwav_companion.tracking.landmarks.landmark_estimate import LandmarkEstimate
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.types import LandmarkState

EstimateT = TypeVar("EstimateT", bound=LandmarkEstimate)

LEFT_OUT = 30.0
"""Squared Mahalanobis distance of a landmark from its place by all else, beyond which it is left out. It is examined
once a second, and a right landmark exceeds this once in 700 000 (3 degrees of freedom)."""
DOUBTED = 16.3
"""The same distance, beyond which a landmark is left out if it stays there and all others are clearly nearer: a right
landmark exceeds it once in a thousand. Of three landmarks, one that is off by 0.4 m is named in 8 of 12 flights
of 45 s. A batch over the whole flight, linearized at the truth, names it in 9 at the same margin."""
DOUBTED_TIMES = 10
"""Number of examinations in a row beyond DOUBTED before a landmark is left out."""
CLEAR = 9.0
"""Difference of these distances below which landmarks contradict one another and the flight does not show which is
wrong: a likelihood ratio of 90."""
ALL_LEFT_OUT = 2.0 * LEFT_OUT
"""The same distance as LEFT_OUT, where the flight does not show which of several is wrong: later sights may show it."""
SUSPECT = 7.8
"""The same distance, beyond which a landmark is a suspect: a right one exceeds it once in twenty, and then widens
covariances."""


def examined(state: EstimateT, *, at_once: bool = False) -> EstimateT:
    """The state without the landmark that all else contradicts most, or without all that are contradicted alike.

    ``at_once``: whether landmarks that are far off are left out before later examinations can show which is wrong.
    """
    used = [i for i, record in enumerate(state.records) if record.state is LandmarkState.USED]
    without = {i: released(state, i) for i in used}
    distances = {i: distance2(without[i], i) for i in used}
    worst = max(distances.values(), default=0.0)
    wrong = [i for i in used if distances[i] > worst - CLEAR]
    state = _doubting(state, wrong, worst)
    if not _is_decided(state, len(wrong), worst, at_once=at_once):
        suspects = [i for i in used if distances[i] > SUSPECT] if len(used) > 1 else []
        shown = suspects if worst > DOUBTED and state.unresolved >= DOUBTED_TIMES else []
        return replace(contradicting(state, used, shown), suspects=tuple(suspects))
    state = contradicting(state, used, wrong if len(wrong) > 1 else [])
    for i in wrong:
        off_m = hypot(*map(float, off(without[i], i)))
        record = replace(state.records[i], state=LandmarkState.LEFT_OUT, off_m=off_m)
        state = released(state, i).recorded(i, record)
    return replace(state, suspects=(), unresolved=0)


def _is_decided(state: LandmarkEstimate, wrong: int, worst: float, *, at_once: bool) -> bool:
    """Whether landmarks are left out. ``wrong``: number of landmarks that are contradicted alike."""
    if wrong == 1:
        return worst > LEFT_OUT or state.doubted[1] >= DOUBTED_TIMES
    return worst > ALL_LEFT_OUT and (at_once or state.unresolved >= DOUBTED_TIMES)


def contradicting(state: EstimateT, used: Sequence[int], shown: Sequence[int]) -> EstimateT:
    """The state with records that name, for each landmark in ``shown``, the landmarks that it contradicts."""
    for i in used:
        others = tuple(state.records[k].label for k in (shown if len(shown) > 1 else used) if k != i)
        record = replace(state.records[i], contradicts=others if i in shown else ())
        state = state.recorded(i, record)
    return state


def _doubting(state: EstimateT, wrong: Sequence[int], worst: float) -> EstimateT:
    """The state with its counts of examinations beyond DOUBTED: in a row of the same single landmark, and of any."""
    unresolved = state.unresolved + 1 if worst > DOUBTED else 0
    if len(wrong) != 1 or worst <= DOUBTED:
        return replace(state, doubted=(-1, 0), unresolved=unresolved)
    landmark, times = state.doubted
    again = times + 1 if landmark == wrong[0] else 1
    return replace(state, doubted=(wrong[0], again), unresolved=unresolved)


def released(state: EstimateT, landmark: int) -> EstimateT:
    """The state without the survey of one landmark, whose place is then as good as unknown."""
    return state.after(release(state.model, landmark))


def release(model: SharedErrors, landmark: int) -> Correction:
    """The measurement with a negative variance that removes the prior of a landmark's place."""
    rows = np.zeros((3, model.size))
    rows[:, model.survey(landmark)] = np.eye(3)
    claimed = model.landmarks[landmark].sigma_m ** 2
    return Correction(np.zeros(3), rows, -claimed * UNKNOWN_M**2 / (UNKNOWN_M**2 - claimed) * np.eye(3))


def off(state: LandmarkEstimate, landmark: int) -> Array:
    """(3) Place of a released landmark by the sights, minus its known place, metres."""
    return state.mean[state.model.survey(landmark)]


def distance2(state: LandmarkEstimate, landmark: int) -> float:
    """Squared Mahalanobis distance of a released landmark from its known place, 3 degrees of freedom."""
    survey = state.model.survey(landmark)
    cov = state.cov[survey, survey] + state.model.landmarks[landmark].sigma_m ** 2 * np.eye(3)
    away = off(state, landmark)
    return float(away @ np.linalg.solve(cov, away))
