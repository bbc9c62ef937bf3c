"""Landmarks that disagree: each is examined by the state without its claim.

One that all else contradicts is left out. Where landmarks contradict one another and the flight does not show which is
wrong, all stay and are named together, and the claim of each target is wider by what its place moves without each of
them: the solution separation of Brown and McBurney (Navigation 35, 1988).
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
"""Squared Mahalanobis distance of a landmark from where all else shows it, beyond which it is left out: it is examined
once a second, and a right one exceeds this once in three million."""
DOUBTED = 16.3
"""The same distance beyond which it is left out when it stays there, and all others are clearly nearer: a right one
exceeds it once in a thousand. Of three, one that is off by 0.4 m is named in 8 of 12 flights of 45 s; a batch over the
whole flight, linear about the truth, names it in 9 at the same margin."""
DOUBTED_TIMES = 10
"""Examinations in a row."""
CLEAR = 9.0
"""Landmarks whose distances differ by less contradict one another, and the flight does not show which is wrong: a ratio
of likelihoods of 90."""
ALL_LEFT_OUT = 2.0 * LEFT_OUT
"""The same distance where the flight does not show which of several is wrong: later sights may."""
SUSPECT = 7.8
"""The same distance of a suspect: a right one exceeds it once in twenty, and then widens claims."""


def examined(state: EstimateT, *, at_once: bool = False) -> EstimateT:
    """The state without the landmark that all else contradicts the most; without all that it contradicts alike.

    ``at_once``: whether what is far off is left out before later examinations can show which of several is wrong.
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
    """Whether the ``wrong`` landmarks that are contradicted alike are left out."""
    if wrong == 1:
        return worst > LEFT_OUT or state.doubted[1] >= DOUBTED_TIMES
    return worst > ALL_LEFT_OUT and (at_once or state.unresolved >= DOUBTED_TIMES)


def contradicting(state: EstimateT, used: Sequence[int], shown: Sequence[int]) -> EstimateT:
    """The state whose records name, for each of the landmarks ``shown``, those that it contradicts."""
    for i in used:
        others = tuple(state.records[k].label for k in (shown if len(shown) > 1 else used) if k != i)
        record = replace(state.records[i], contradicts=others if i in shown else ())
        state = state.recorded(i, record)
    return state


def _doubting(state: EstimateT, wrong: Sequence[int], worst: float) -> EstimateT:
    """The state with one more examination beyond DOUBTED: of the same single landmark, or of several."""
    unresolved = state.unresolved + 1 if worst > DOUBTED else 0
    if len(wrong) != 1 or worst <= DOUBTED:
        return replace(state, doubted=(-1, 0), unresolved=unresolved)
    landmark, times = state.doubted
    again = times + 1 if landmark == wrong[0] else 1
    return replace(state, doubted=(wrong[0], again), unresolved=unresolved)


def released(state: EstimateT, landmark: int) -> EstimateT:
    """The state without the claim of one landmark: its place is as good as unknown."""
    return state.after(release(state.model, landmark))


def release(model: SharedErrors, landmark: int) -> Correction:
    """The measurement with a negative variance that takes the prior of a landmark's place back."""
    rows = np.zeros((3, model.size))
    rows[:, model.survey(landmark)] = np.eye(3)
    claimed = model.landmarks[landmark].sigma_m ** 2
    return Correction(np.zeros(3), rows, -claimed * UNKNOWN_M**2 / (UNKNOWN_M**2 - claimed) * np.eye(3))


def off(state: LandmarkEstimate, landmark: int) -> Array:
    """(3) where the sights show a landmark whose claim is taken back, minus its known place, metres."""
    return state.mean[state.model.survey(landmark)]


def distance2(state: LandmarkEstimate, landmark: int) -> float:
    """Squared Mahalanobis distance between the two."""
    survey = state.model.survey(landmark)
    cov = state.cov[survey, survey] + state.model.landmarks[landmark].sigma_m ** 2 * np.eye(3)
    away = off(state, landmark)
    return float(away @ np.linalg.solve(cov, away))
