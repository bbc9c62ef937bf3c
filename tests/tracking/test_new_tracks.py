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
FAR_M = 100.0
"""Where false detections are."""
OUTSIDE = (6.0 * SIGMA_M, 0.0, 0.0)


def after(*positions, known=60, apart_s=0.05, false_every=0):
    """The tracker after a target at the origin was seen often, and after one frame with fixes at these places.

    ``false_every``: number of frames of which one has a false detection; 0: none has.
    """
    tracker = make_tracker(TrackingOptions(), priors())
    noise = np.diag([SIGMA_M**2, SIGMA_M**2, 0.01])
    for k in range(known):
        false = [(FAR_M * k, 0.0, 0.0)] if false_every and k and k < known - 10 and k % false_every == 0 else []
        tracker.on_frame(a_view(0.05 * k, *(a_fix(0.05 * k, place, noise) for place in [(0.0, 0.0, 0.0), *false])))
    t = 0.05 * (known - 1) + apart_s
    return tracker, tracker.on_frame(a_view(t, *(a_fix(t, place, noise) for place in positions)))


def test_a_stray_fix_in_the_gate_of_a_track_without_one_begins_no_track():
    """Of a detector with a false detection in every third frame, it is not likely to be the target's."""
    tracker, tracks = after(INSIDE, false_every=3)
    assert [(track.id, track.fix) for track in tracks] == [(1, None)]
    assert tracker.unused_fixes == {Reason.WEAK_EVIDENCE: 1}


def test_a_track_that_was_just_seen_takes_a_stray_fix_rather_than_to_be_missed():
    """The detector finds 19 of 20 and has hardly a false detection: a target that is missed just where a false one lies
    in its gate is less likely than a far fix of its own. A track that coasts may have left.
    """
    tracker, tracks = after(INSIDE)
    assert [(track.id, track.fix is not None) for track in tracks] == [(1, True)]
    assert not tracker.unused_fixes
    assert after(INSIDE, apart_s=0.4)[1][0].fix is None


@pytest.mark.parametrize(
    ("positions", "apart_s"),
    [((OUTSIDE,), 0.05), (((0.0, 0.0, 0.0), INSIDE), 0.05), ((INSIDE,), 0.4)],
    ids=["outside the gate", "next to the track's own fix", "of a track that coasts"],
)
def test_another_target_begins_its_track(positions, apart_s):
    tracker, tracks = after(*positions, apart_s=apart_s)
    assert [track.id for track in tracks] == [1, 2]
    assert not tracker.unused_fixes
