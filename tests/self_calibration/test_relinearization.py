"""Passes over kept pixel measurements: which ones count toward a pass, what ends it, and its result."""

import msgspec
import pytest
from simulated_flight import Flight
from simulated_world import World

from fwav_companion.self_calibration import relinearization as passes
from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.pixel_measurement import COMMON_COUNT, SharedParameter, pixel_measurement
from fwav_companion.self_calibration.relinearization import Relinearization

FLIGHT = Flight(seconds=12, fps=15.0, shape="hover", height_m=10.0, targets=((4.0, 3.0),), pixel_px=0.5)
AROUND = (0.0,) * COMMON_COUNT


@pytest.fixture(scope="module")
def glimpses():
    world = World(FLIGHT)
    fixes = [fix for view in world.frames() for fix in view.fixes]
    return [pixel_measurement(1, fix, delayed_poses(fix.sighting.state, (0.0,), world.state_at), 0.07) for fix in fixes]


def of_track(track, glimpses):
    return [msgspec.structs.replace(glimpse, track=track) for glimpse in glimpses]


def fed(state, glimpses, shop=None):
    for glimpse in glimpses:
        state = state.with_glimpse(glimpse)
        state = state if shop is None else state.advanced(shop)
    return state


def test_what_is_kept_of_targets_that_ended_makes_no_passes_and_fills_nothing(glimpses, monkeypatch):
    """Clutter tracks end within a second and recur constantly: they must not cost the true target its passes."""
    monkeypatch.setattr(passes, "MOST_KEPT", 30)
    state = Relinearization()
    for k in range(8):
        state = fed(state, of_track(10 + k, glimpses[:20])).only({1})
    state = fed(state, glimpses[:25])
    assert state.complete
    assert len(state.kept) == 25


def test_a_pass_is_begun_at_so_many_glimpses_of_each_target_there_is(glimpses):
    shop = CalibrationContext(FLIGHT.priors, None)
    clutter = of_track(9, glimpses[:50])
    state = fed(Relinearization(), [*clutter, *glimpses[:12]]).only({1}).begun(shop, AROUND)
    for _ in range(3):
        state = state.advanced(shop)
    state = fed(state, glimpses[12:59], shop)
    assert state.served is not None
    assert state.done == 0
    assert fed(state, glimpses[59:62], shop).done == 1


def test_too_many_to_keep_end_the_passes_and_what_is_served_goes_on(glimpses, monkeypatch):
    monkeypatch.setattr(passes, "MOST_KEPT", 60)
    shop = CalibrationContext(FLIGHT.priors, None)
    state = fed(fed(Relinearization(), glimpses[:20]).begun(shop, AROUND), glimpses[20:], shop)
    assert (state.kept, state.complete, state.coming) == ((), False, None)
    assert state.served.used > 100
    assert state.served.joint.places[1] == pytest.approx((4.0, 3.0), abs=0.3)


def test_glimpses_shrink_to_the_delay_that_was_found(glimpses):
    shop = CalibrationContext(FLIGHT.priors, None)
    around = (0.02, *AROUND[1:])
    state = fed(Relinearization(), glimpses[:5]).begun(shop, around)
    assert state.delay_s == state.coming.joint.around[SharedParameter.DELAY] == 0.02
    assert [[moment.delay_s for moment in glimpse.course.moments] for glimpse in state.kept] == [[0.02]] * 5
