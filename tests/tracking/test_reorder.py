"""Frames out of order: the effect of a late one, when a result is settled, and which frames are refused."""

import numpy as np
import pytest
from draws import first_of
from handmade import a_fix, a_view, host_ns
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.tracking import Reorder, TrackingOptions, make_tracker
from fwav_companion.types import NoFrame, Reason

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0)


def flight_views(seed=3):
    rng = np.random.default_rng(seed)
    views = []
    for k in range(40):
        fixes = [a_fix(k / 30, (4 + rng.normal() * 0.2, 3 + i * 5, 0)) for i in range(int(rng.integers(0, 3)))]
        views.append(a_view(k / 30, *fixes))
    return views


def settled(order_of_arrival, **options):
    """(lines, last tracks) for (view, arrival) pairs in order of arrival."""
    reorder, lines, last = Reorder(make_tracker(TrackingOptions(**options), NO_BIAS)), [], ()
    for view, arrival in order_of_arrival:
        last = reorder.put(view, host_ns(arrival))
        lines += reorder.close(host_ns(arrival))
    lines += reorder.close(host_ns(1e4))
    return lines, last


@settings(max_examples=25, derandomize=True, deadline=None)
@given(st.lists(st.floats(0.0, 0.45), min_size=40, max_size=40), st.sampled_from(["kalman", "lowpass"]))
def test_late_frames_leave_what_they_leave_in_time(delays, kind):
    views = flight_views()
    in_time, last = settled([(view, k / 30) for k, view in enumerate(views)], filter=kind)
    late = sorted(
        ((view, k / 30 + d) for k, (view, d) in enumerate(zip(views, delays, strict=True))), key=lambda a: a[1]
    )
    out_of_order, other = settled(late, filter=kind)
    assert out_of_order == in_time
    assert other == last


@pytest.mark.parametrize("seconds", first_of(8, 16))
def test_a_late_frame_leaves_the_same_with_self_calibration(seconds):
    flight = Flight(seconds=seconds, fps=20, shape="hover", height_m=10.0, targets=((4.0, 3.0),))
    flight.biases[6] = 0.035
    world = World(flight)
    views = world.frames()

    def run(delay):
        reorder = Reorder(make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at))
        arrivals = sorted(((v, k / 20 + delay * (k % 7 == 3)) for k, v in enumerate(views)), key=lambda a: a[1])
        return [reorder.put(view, host_ns(t)) for view, t in arrivals][-1]

    assert run(0.31) == run(0.0)


def test_lines_are_settled_once_in_order_half_a_second_after_capture():
    reorder = Reorder(make_tracker(TrackingOptions(), NO_BIAS))
    for t in (0.0, 0.2, 0.1):
        reorder.put(a_view(t), host_ns(0.3))
    assert reorder.wake_at == host_ns(0.5)
    assert [line.view.frame for line in reorder.close(host_ns(0.499))] == []
    assert [line.view.frame for line in reorder.close(host_ns(0.6))] == [0, 100]
    assert [line.view.frame for line in reorder.close(host_ns(0.6))] == []
    assert reorder.wake_at == host_ns(0.7)
    assert [line.view.frame for line in reorder.close(host_ns(0.7))] == [200]
    assert reorder.wake_at is None


def test_what_cannot_be_put_in_is_refused_by_name():
    reorder = Reorder(make_tracker(TrackingOptions(), NO_BIAS))
    reorder.put(a_view(1.0), host_ns(1.0))
    assert reorder.put(a_view(1.0), host_ns(1.1)) == NoFrame(Reason.DUPLICATE_FRAME)
    assert reorder.put(a_view(0.6), host_ns(1.1)) == NoFrame(Reason.TOO_LATE)
    assert reorder.close(host_ns(1.5)) != []
    assert reorder.put(a_view(0.99), host_ns(1.4)) == NoFrame(Reason.TOO_LATE)


def test_the_window_is_bounded():
    reorder = Reorder(make_tracker(TrackingOptions(), NO_BIAS))
    answers = [reorder.put(a_view(k / 1000), host_ns(0.2)) for k in range(140)]
    assert answers.count(NoFrame(Reason.TOO_MANY_FRAMES)) == 12


def test_an_id_that_a_rewind_takes_back_is_given_again():
    """Two newborns, then a frame from before: the ids are those that order of capture gives."""
    frames = [a_view(0.1 * k, a_fix(0.1 * k, (4, 3, 0)), a_fix(0.1 * k, (40, 3, 0))) for k in range(1, 4)]
    early = a_view(0.05, a_fix(0.05, (80, 3, 0)))
    reorder = Reorder(make_tracker(TrackingOptions(), NO_BIAS))
    for view in (*frames, early):
        tracks = reorder.put(view, host_ns(0.4))
    assert [(t.id, round(t.position_ned[0])) for t in tracks] == [(1, 80), (2, 4), (3, 40)]
    assert [t.id for t in settled([(v, 0.4) for v in (early, *frames)])[1]] == [1, 2, 3]


def test_dropping_all_settles_what_waits():
    reorder = Reorder(make_tracker(TrackingOptions(), NO_BIAS))
    reorder.put(a_view(0.1, a_fix(0.1, (4, 3, 0))), host_ns(0.2))
    (dropped,) = reorder.drop_all(Reason.ORIGIN_SET, a_view(0.2))
    assert dropped.reason is Reason.ORIGIN_SET
    assert [line.view.frame for line in reorder.close(host_ns(0.2))] == [100]
    assert reorder.put(a_view(0.15), host_ns(0.25)) == NoFrame(Reason.TOO_LATE)
    assert reorder.put(a_view(0.22, a_fix(0.22, (4, 3, 0))), host_ns(0.25))[0].id == 2
