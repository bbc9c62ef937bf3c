"""Passes over kept pixel measurements: which ones count toward a pass, what ends it, and its result."""

from itertools import pairwise

import msgspec
import numpy as np
import pytest
from path_batches import along
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration import SharedParameter
from fwav_companion.self_calibration import relinearization as passes
from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.measurement_batch import measurement_batch
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.self_calibration.position_path import PositionPath
from fwav_companion.self_calibration.relinearization import Relinearization
from fwav_companion.self_calibration.vehicle_motion import moved, smoothed_back
from fwav_companion.types import BIAS_COUNT, Bias

FLIGHT = Flight(seconds=12, fps=15.0, shape="hover", height_m=10.0, targets=((4.0, 3.0),), pixel_px=0.5)
POINT = np.zeros(SHARED_COUNT)


@pytest.fixture(scope="module")
def batches():
    world = World(FLIGHT)
    fixes = [fix for view in world.frames() for fix in view.fixes]
    return [
        measurement_batch([(1, fix)], delayed_poses([fix.sighting.state], (0.0,), world.state_at), (0.07,))
        for fix in fixes
    ]


def of_track(track, batches):
    return [msgspec.structs.replace(batch, tracks=(track,)) for batch in batches]


def fed(state, batches, context=None):
    for batch in batches:
        state = state.with_batch(batch)
        state = state if context is None else state.advanced(context)
    return state


def test_measurements_of_targets_that_ended_make_no_passes_and_fill_nothing(batches, monkeypatch):
    """Clutter tracks end within a second and recur constantly: they must not cost the true target its passes."""
    monkeypatch.setattr(passes, "MOST_KEPT", 30)
    state = Relinearization()
    for k in range(8):
        state = fed(state, of_track(10 + k, batches[:20])).only({1})
    state = fed(state, batches[:25])
    assert state.complete
    assert len(state.kept) == 25
    assert state.tracks == {1}


def test_a_pass_begins_at_a_number_of_measurements_of_each_live_target(batches):
    context = CalibrationContext(FLIGHT.priors, None)
    clutter = of_track(9, batches[:50])
    state = fed(Relinearization(), [*clutter, *batches[:12]]).only({1}).begun(context, POINT)
    for _ in range(12):
        state = state.advanced(context)
    state = fed(state, batches[12:23], context)
    assert state.served is not None
    assert state.passed == 12
    assert fed(state, batches[23:26], context).passed == passes.SETTLED_GROWTH * 12


def test_passes_follow_as_measurements_grow_and_end_with_the_mount_known(batches, monkeypatch):
    context = CalibrationContext(FLIGHT.priors, None)

    def passed_at(*, settled):
        state = fed(Relinearization(), batches[:40]).begun(context, POINT)
        counts = [state.passed]
        for batch in batches[40:110]:
            state = state.with_batch(batch).advanced(context, 200, settled=settled)
            counts.append(state.passed)
        return list(dict.fromkeys(counts))

    assert passed_at(settled=True) == [40, passes.SETTLED_GROWTH * 40]
    counts = passed_at(settled=False)
    assert len(counts) >= 3
    assert all(0 <= after - passes.GROWTH * before <= 2 for before, after in pairwise(counts))
    monkeypatch.setattr(passes, "ENOUGH", 40)
    assert passed_at(settled=True) == [40]


def test_too_many_to_keep_end_the_passes_and_what_is_served_goes_on(batches, monkeypatch):
    monkeypatch.setattr(passes, "MOST_KEPT", 60)
    context = CalibrationContext(FLIGHT.priors, None)
    state = fed(fed(Relinearization(), batches[:20]).begun(context, POINT), batches[20:], context)
    assert (state.kept, state.complete, state.coming) == ((), False, None)
    assert state.served.used[0] > 100
    assert state.served.joint.targets[1][0] == pytest.approx((4.0, 3.0), abs=0.3)


def test_kept_poses_shrink_to_the_delay_that_was_found(batches):
    context = CalibrationContext(FLIGHT.priors, None)
    point = POINT.copy()
    point[SharedParameter.DELAY] = 0.02
    state = fed(Relinearization(), batches[:5]).begun(context, point)
    assert state.delay_s == state.coming.joint.linearization_point[0, SharedParameter.DELAY] == 0.02
    assert [batch.poses.delay_s.tolist() for batch in state.kept] == [[[0.02]]] * 5


def test_the_served_estimate_takes_each_new_batch_at_once(batches):
    context = CalibrationContext(FLIGHT.priors, None)
    state = fed(Relinearization(), batches[:20]).begun(context, POINT).advanced(context, 20)
    used = state.served.used[0]
    assert fed(state, batches[20:22]).served.used[0] == used + 2


def test_passes_are_over_the_path_smoothed_by_later_positions(batches):
    """The first reports of a view are 0.5 m off, and the path by earlier reports alone has most of that for a second.
    A track that ended held the batch before them.
    """
    context, smoother, on_path = CalibrationContext(FLIGHT.priors, None), PositionPath(), []
    noisy = msgspec.structs.replace(FLIGHT.priors, position_noise_m=0.3)
    for k, batch in enumerate(batches[:40]):
        reported = moved(batch, np.array([(0.5 if k < 3 else 0.0, 0.0, 0.0)]))
        smoother, after = along(smoother, reported, k / 15.0, noisy)
        on_path.append(after)
    clutter = msgspec.structs.replace(on_path[0], tracks=(9,))
    shifts = smoothed_back(on_path)
    smooth = [
        msgspec.structs.replace(moved(batch, shift), paths=()) for batch, shift in zip(on_path, shifts, strict=True)
    ]

    def passed(kept):
        state = fed(Relinearization(), [clutter, *kept]).begun(context, POINT).only({1})
        return state.advanced(context, 200).served.joint.mean

    assert passed(on_path) == pytest.approx(passed(smooth), abs=1e-12)
    assert shifts[0][0, 0] < -0.2  # otherwise nothing was smoothed


def test_a_pass_about_a_delay_that_was_found_stays_there_while_its_mean_is_still_the_prior():
    """The point of a target moves under its first measurements. The delay moved with it, to the prior: 25 ms off, a
    quarter of a beat. Poses extrapolated to there fit nothing: the pass refused two of three measurements and ended 5
    ms off, at a claim of 0.3 ms.
    """
    delay_s = 0.025
    sigmas = priors(time_offset=0.01, position_north=1.0, position_east=1.0, pixel_noise_px=1.0)
    flight = Flight(
        seconds=8.0, fps=15.0, shape="hover", height_m=10.0, pitch_deg=0.0, flapping_deg=15.0, flapping_hz=10.0,
        attitude_hz=100.0, targets=((1.0, -1.5),), pixel_px=1.0, priors=sigmas,
        biases=delay_s * np.eye(BIAS_COUNT)[Bias.TIME_OFFSET],
    )  # fmt: skip
    world = World(flight)
    context = CalibrationContext(sigmas, world.state_at)
    point = delay_s * np.eye(SHARED_COUNT)[SharedParameter.DELAY]
    state = context.served_pass(point, {1: np.array([[1.6, -0.9]])})
    for fix in [fix for view in world.frames() for fix in view.fixes]:
        state = state.fed(context.batch([(1, fix)], delay_s, (0.07,)))
    off = state.joint.mean[:, SharedParameter.DELAY] - delay_s
    assert (state.refused <= 3).all()
    assert (np.abs(off) < 0.4e-3).all()
