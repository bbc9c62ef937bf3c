"""A landmark that disagrees a little, for long: named where it alone does."""

import numpy as np
import pytest
from handmade import a_fix
from msgspec.structs import replace
from simulated_flight import priors

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.tracking.landmarks.joint_place import Correction
from fwav_companion.tracking.landmarks.landmark_examination import DOUBTED_TIMES, examined
from fwav_companion.tracking.landmarks.landmark_target import LandmarkTracking
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.types import BIAS_COUNT, Bias, Landmark, LandmarkState

SURVEY_M, SEEN_M = 0.05, 0.07
USED, LEFT_OUT = LandmarkState.USED, LandmarkState.LEFT_OUT


def unseen(errors, count):
    """The model and the filter of so many landmarks in use, before any sight."""
    place = Geodetic(0.0, 0.0, 0.0)
    model = SharedErrors(errors, [Landmark(f"mark {i}", place, SURVEY_M) for i in range(count)])
    state = LandmarkTracking.start(model)
    return model, replace(state, records=tuple(replace(record, state=USED) for record in state.records))


def shown(*off_m):
    """The filter after sights that show each landmark off by so much in the north, one sigma of SEEN_M."""
    model, state = unseen(priors(), len(off_m))
    for i, off in enumerate(off_m):
        rows = np.zeros((3, model.size))
        rows[:, model.survey(i)] = np.eye(3)
        state = state.after(Correction(np.array((-off, 0.0, 0.0)), rows, SEEN_M**2 * np.eye(3)))
    return state


def seen_through_the_position(*off_m):
    """The filter after sights that show each landmark off in the north, by a position of 1 m that they share."""
    model, state = unseen(by_receiver(), len(off_m))
    for i, off in enumerate(off_m):
        rows = np.zeros((3, model.size))
        rows[:, model.survey(i)] = np.eye(3)
        first, processes = model.wander.start, (model.wander.stop - model.wander.start) // 4
        for axis in (0, 1):
            rows[axis, first + 2 * axis * processes : first + 2 * (axis + 1) * processes : 2] = 1.0
        state = state.after(Correction(np.array((off, 0.0, 0.0)), rows, 0.02**2 * np.eye(3)))
    return state


def by_receiver():
    return priors(position_north=1.0, position_east=1.0, position_noise_m=0.02)


def a_target(state):
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[0, Bias.POSITION_NORTH] = jacobian[1, Bias.POSITION_EAST] = 1.0
    return state.initiate(a_fix(0.0, (3.0, 4.0, 0.0), jacobian=jacobian))


def test_a_landmark_that_is_left_out_takes_back_what_it_moved():
    """The third is off by 1.2 m; then a target that it had moved is where the other two alone put it."""
    state = replace(seen_through_the_position(0.0, 0.0, 1.2), steps=())
    moved, without = a_target(state), a_target(seen_through_the_position(0.0, 0.0))
    assert np.hypot(*(moved.joint.place - without.joint.place)) > 0.3
    state = examined(state)
    assert [record.state for record in state.records] == [USED, USED, LEFT_OUT]
    back = moved.after(state).joint
    assert back.place == pytest.approx(without.joint.place, abs=1e-3)
    assert back.cov[:2, :2] == pytest.approx(without.joint.cov[:2, :2], rel=1e-3)


@pytest.mark.parametrize("off_m", [0.0, 0.3])
def test_two_that_contradict_each_other_widen_the_claim_of_a_target(off_m):
    """Either may be right: the place is 0.15 m off by each of two answers."""
    state = examined(seen_through_the_position(0.0, off_m))
    assert {record.state for record in state.records} == {USED}
    target = a_target(state)
    alone = target.joint.cov[0, 0]
    assert target.cov[0][0] - alone == pytest.approx(2.0 * (0.5 * off_m) ** 2, rel=0.05)


def states_after(state, examinations):
    for _ in range(examinations):
        state = examined(state)
    return [record.state for record in state.records]


def test_one_that_stays_beyond_a_thousandth_is_left_out_after_ten_looks():
    """0.38 m at a sigma of 0.086 m: a squared distance of 19.5."""
    state = shown(0.0, 0.38, 0.0)
    assert states_after(state, DOUBTED_TIMES - 1) == [USED, USED, USED]
    assert states_after(state, DOUBTED_TIMES) == [USED, LEFT_OUT, USED]


@pytest.mark.parametrize("off_m", [(0.0, 0.32, 0.0), (0.0, 0.40, 0.36)])
def test_what_chance_makes_and_what_may_be_either_stays(off_m):
    """14 for one alone; 21.6 and 17.5 for two, of which either may be right."""
    assert set(states_after(shown(*off_m), 3 * DOUBTED_TIMES)) == {USED}


def test_two_that_contradict_each_other_for_ten_looks_are_named_together():
    """0.5 m at 0.09 m of sigma: either may be right. After 1.5 m both are left out, and named together as well."""
    state = seen_through_the_position(0.0, 0.5)
    for looks in range(1, DOUBTED_TIMES + 1):
        state = examined(state)
        assert [record.contradicts for record in state.records] == (
            [("mark 1",), ("mark 0",)] if looks == DOUBTED_TIMES else [(), ()]
        )
    assert {record.state for record in state.records} == {USED}
    state = seen_through_the_position(0.0, 1.5)
    assert states_after(state, DOUBTED_TIMES - 1) == [USED, USED]
    for _ in range(DOUBTED_TIMES):
        state = examined(state)
    assert [record.state for record in state.records] == [LEFT_OUT, LEFT_OUT]
    assert [record.contradicts for record in state.records] == [("mark 1",), ("mark 0",)]


def test_what_is_far_off_is_left_out_at_once():
    assert states_after(shown(0.0, 0.6, 0.0), 1) == [USED, LEFT_OUT, USED]
