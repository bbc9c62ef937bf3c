"""A fix that a confirmed track should have had begins no other one."""

import numpy as np
import pytest
from handmade import a_fix, a_view
from simulated_flight import priors

from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import Reason

SIGMA_M = 1.5
INSIDE = (3.9 * SIGMA_M, 0.0, 0.0)
"""In the gate of four sigma, where clutter is likelier."""
OUTSIDE = (6.0 * SIGMA_M, 0.0, 0.0)


def after(*positions, known=60, apart_s=0.05):
    """The tracker after a target at the origin was seen often, and after one frame with fixes at these places."""
    tracker = make_tracker(TrackingOptions(), priors())
    noise = np.diag([SIGMA_M**2, SIGMA_M**2, 0.01])
    for k in range(known):
        tracker.on_frame(a_view(0.05 * k, a_fix(0.05 * k, (0.0, 0.0, 0.0), noise)))
    t = 0.05 * (known - 1) + apart_s
    return tracker, tracker.on_frame(a_view(t, *(a_fix(t, place, noise) for place in positions)))


def test_a_stray_fix_in_the_gate_of_a_track_without_one_begins_no_track():
    tracker, tracks = after(INSIDE)
    assert [(track.id, track.fix) for track in tracks] == [(1, None)]
    assert tracker.unused_fixes == {Reason.WEAK_EVIDENCE: 1}


@pytest.mark.parametrize(
    ("positions", "apart_s"),
    [((OUTSIDE,), 0.05), (((0.0, 0.0, 0.0), INSIDE), 0.05), ((INSIDE,), 0.4)],
    ids=["outside the gate", "next to the track's own fix", "of a track that coasts"],
)
def test_another_target_begins_its_track(positions, apart_s):
    tracker, tracks = after(*positions, apart_s=apart_s)
    assert [track.id for track in tracks] == [1, 2]
    assert not tracker.unused_fixes
