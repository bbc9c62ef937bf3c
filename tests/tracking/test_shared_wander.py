"""How the vehicle's position wanders: one evidence for all targets, kept by the tracker."""

import numpy as np
from handmade import a_fix, a_view
from simulated_flight import priors
from wandering_positions import first_order_error

from fwav_companion.tracking import Reorder, TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias

P = priors(mount_x=0, mount_y=0, mount_z=0, heading=0, time_offset=0, position_north=1.0, position_east=1.0)
TIMES = np.arange(0.0, 20.0, 0.1)
PLACES = ((0.0, 0.0), (40.0, 0.0), (0.0, 40.0))
JACOBIAN = np.zeros((3, BIAS_COUNT))
JACOBIAN[[0, 1], [Bias.POSITION_NORTH, Bias.POSITION_EAST]] = 1.0


def views(seen, errors):
    """Frames in which target k is seen where ``seen(k, t)``."""
    rng = np.random.default_rng(5)
    for t, error in zip(TIMES, errors, strict=True):
        fixes = [
            a_fix(t, (*(np.array(place) + error + rng.normal(0.0, 0.1, 2)), 0.0), np.diag([0.01, 0.01, 0.0]), JACOBIAN)
            for k, place in enumerate(PLACES)
            if seen(k, t)
        ]
        yield a_view(t, *fixes)


def fast():
    return first_order_error(np.random.default_rng(1), TIMES, 60.0)


def evidence(tracker):
    """The evidence of every live target."""
    return [track.target.wander_evidence for track in tracker.snapshot().alive]


def test_a_new_target_begins_with_what_the_flight_has_shown():
    tracker = make_tracker(TrackingOptions(), P)
    for view in views(lambda k, t: (k == 0) == (t < 19.85), fast()):
        tracker.on_frame(view)
    known = tracker.snapshot().wander
    assert known.smooth_share < 0.1
    assert len(evidence(tracker)) == 3
    assert all(each is known for each in evidence(tracker))


def test_a_second_counts_once_whatever_the_number_of_targets():
    tracker, until = make_tracker(TrackingOptions(), P), set()
    for view in views(lambda _, t: t > 0.0, fast()):
        tracker.on_frame(view)
        if tracker.snapshot().wander is not None:
            until.add(tracker.snapshot().wander.until_ns)
    assert len(until) > 10
    assert min(np.diff(sorted(until))) >= 1_000_000_000


def test_frames_that_come_late_leave_the_same_evidence():
    frames, left = list(views(lambda _, t: t > 0.0, fast())), []
    late = list(frames)
    for k in range(15, len(frames) - 1, 7):
        late[k], late[k + 1] = late[k + 1], late[k]
    for order in (frames, late):
        tracker = make_tracker(TrackingOptions(), P)
        reorder = Reorder(tracker)
        for k, view in enumerate(order):
            reorder.put(view, frames[min(k + 1, len(frames) - 1)].host_ns)
        left.append(tracker.snapshot().wander)
    assert left[0].until_ns > 0
    assert left[0] == left[1]


def test_clutter_shows_nothing():
    tracker = make_tracker(TrackingOptions(), P)
    for view in views(lambda k, t: k == 0 and t < 0.15, fast()):
        tracker.on_frame(view)
    assert tracker.snapshot().wander is None
