"""A confirmed track has priority over a new one, except where the new one is far more likely."""

import numpy as np
import pytest
from handmade import a_fix, a_view
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.tracking.association import associate
from fwav_companion.tracking.clutter import clutter
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.joint_association import jointly_gated
from fwav_companion.tracking.pair_costs import Candidate, TracksAndFixes
from fwav_companion.types.tracks import GateResult

CLUTTER = clutter(DetectorModel(), 640.0 * 480.0)
NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0)


def test_a_believed_track_does_not_wander_to_a_target_that_was_seen_first_by_a_newborn():
    """With this seed a new track returns for a second detection when the other target, 4 m away, is in the image
    alone.
    """
    targets = ((2.0, 3.0), (6.0, 3.0), (4.0, 6.46))
    still = {"targets": targets, "velocities": ((0.0, 0.0),) * 3, "labels": ("",) * 3}
    flight = Flight(seed=11, miss=0.1, clutter=0.1, **still)
    tracker, nearest = make_tracker(TrackingOptions(), flight.priors), set()
    for view in World(flight).frames()[:360]:
        for track in tracker.on_frame(view):
            if track.id == 1 and track.fix is not None:
                nearest.add(int(np.hypot(*(np.array(targets) - track.fix.position_ned[:2]).T).argmin()))
    assert nearest == {1}


class Expecting:
    """A predicted track for which every fix has this squared distance and this logarithm of the spread."""

    def __init__(self, distance2, spread):
        self._result = GateResult(distance2, spread)

    def gate(self, _fix):
        return self._result


@pytest.mark.parametrize(("ratio", "takes"), [(40.0, "believed"), (70.0, "newborn")])
@pytest.mark.parametrize("spread", [-4.0, 3.0])
def test_a_newborn_takes_a_known_targets_fix_where_it_is_more_than_55_times_as_likely(ratio, takes, spread):
    """The likelihood of a fix at distance d with spread s is exp(-(d^2 + s) / 2) but for a common factor. With equal
    spread the new track is ``ratio`` times as likely if its squared distance is smaller by 2 log(ratio).
    """
    newborn = Candidate("target", Expecting(1.0, spread), None, confirmed=False)
    believed = Candidate("target", Expecting(1.0 + 2.0 * np.log(ratio), spread), None)
    ((taker, (fix, _)),) = associate(
        [believed, newborn], [a_fix(0.0, (4, 3, 0), label="target")], CLUTTER
    ).pairs.items()
    assert (["believed", "newborn"][taker], fix) == (takes, 0)


class At(Expecting):
    """The same at a place."""

    def __init__(self, distance2, north):
        super().__init__(distance2, 3.0)
        self.apparent_ned = (north, 0.0, 0.0)


@pytest.mark.parametrize(("farther", "takes"), [(2.0, 4.0), (6.0, 9.0)])
def test_a_target_in_view_takes_the_fix_unless_the_one_out_of_view_is_far_likelier(farther, takes):
    """A detector that finds 9 of 10: twice the log of 9 is 4.4."""
    model = DetectorModel(detection_probability=0.9)
    tracks = [At(1.0 + farther, 4.0), At(1.0, 9.0)]
    taken = associate(
        [Candidate("target", track, None) for track in tracks],
        [a_fix(0.0, (4, 3, 0), label="target")],
        clutter(model, 640.0 * 480.0),
        lambda place: place[0] < 5.0,
    ).pairs
    assert [tracks[i].apparent_ned[0] for i in taken] == [takes]


def test_a_tentative_track_in_view_was_not_missed():
    """A confirmed track that the image's edge may hide, and a tentative one in view, 20 times as likely. The latter has
    no reward for a miss that is avoided: it may be of clutter.
    """
    confirmed, tentative = At(1.0 + 2.0 * np.log(20.0), 9.0), At(1.0, 4.0)
    taken = associate(
        [Candidate("target", confirmed, None), Candidate("target", tentative, None, confirmed=False)],
        [a_fix(0.0, (4, 3, 0), label="target")],
        clutter(DetectorModel(detection_probability=0.9), 640.0 * 480.0),
        lambda place: place[0] < 5.0,
    ).pairs
    assert list(taken) == [0]


@pytest.mark.parametrize(("each_frame", "takes"), [(0.9, True), (1.1, False), (3.0, False)])
def test_where_false_detections_are_dense_no_track_takes_one_to_avoid_a_miss(each_frame, takes):
    """A track of clutter would live on them."""
    model = DetectorModel(detection_probability=0.9, false=each_frame * 1e6, frames=1e6)
    fix, against = a_fix(0.0, (4, 3, 0), label="target"), clutter(model, 1000.0)
    expecting = Expecting(3.0, against.llr_of(fix) - 3.0 + 4.0)
    assert list(associate([Candidate("target", expecting, None)], [fix], against).pairs) == ([0] if takes else [])


@pytest.mark.parametrize(("beyond", "takes"), [(4.0, True), (5.0, False)])
@pytest.mark.parametrize("steady", [True, False])
def test_a_steady_track_takes_a_fix_that_is_less_unlikely_than_a_miss(beyond, takes, steady):
    """A detector that finds 9 of 10: twice the log of 9 is 4.4. ``beyond``: cost of the fix against clutter."""
    fix, against = a_fix(0.0, (4, 3, 0), label="target"), clutter(DetectorModel(detection_probability=0.9), 1000.0)
    expecting = Expecting(3.0, against.llr_of(fix) - 3.0 + beyond)
    taken = associate([Candidate("target", expecting, None, steady=steady)], [fix], against).pairs
    assert list(taken) == ([0] if takes and steady else [])
    assert all(llr == pytest.approx(-0.5 * beyond) for _, llr in taken.values()), "it is evidence against the track"


def test_a_confirmed_track_leaves_its_fix_to_no_other_for_a_false_detection():
    """A fix of the first target, and clutter near it: that two confirmed tracks have fixes then is no reward."""
    fix, false = a_fix(0.0, (4, 3, 0), label="target"), a_fix(0.0, (7, 3, 0), label="target")

    class Near:
        """A target by the squared distances of the two fixes."""

        def __init__(self, *distances2):
            self._distances2 = distances2

        def gate(self, each):
            return GateResult(self._distances2[each is false], 3.0)

    tracks = [Candidate("target", Near(1.0, 13.0), None), Candidate("target", Near(5.0, 50.0), None)]
    assert {i: j for i, (j, _) in associate(tracks, [fix, false], CLUTTER).pairs.items()} == {0: 0}


def test_a_newborn_does_not_take_a_known_targets_fix():
    """A gross detection 0.5 m from the target, with 0.2 m of noise, begins a track; the target's fixes stay its own,
    also one that happens to be nearer to the new track.
    """
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    for k in range(20):
        tracks = tracker.on_frame(a_view(k / 10, a_fix(k / 10, (4.0, 3.0, 0.0))))
    tracker.on_frame(a_view(2.0, a_fix(2.0, (4.0, 3.0, 0.0)), a_fix(2.0, (4.5, 3.0, 0.0))))
    for k in range(21, 24):
        tracks = tracker.on_frame(a_view(k / 10, a_fix(k / 10, (4.35, 3.0, 0.0))))
        assert tracks[0].fix is not None


class Learning:
    """A joint gate that keeps which fixes it learned from."""

    pairs = 0

    def __init__(self):
        self.fixes = []

    def learn(self, _target, fix, *, steady):
        assert steady
        self.fixes.append(fix)


def test_a_steady_tracks_fix_that_is_more_likely_clutter_does_not_show_the_common_biases():
    fixes = [a_fix(0.0, (north, 0.0, 0.0)) for north in (0.0, 50.0)]
    steady = [Candidate("", Expecting(1.0, 0.0), None) for _ in fixes]
    frame, joint = TracksAndFixes(steady, fixes, {0: 10.0, 1: 10.0}, CLUTTER), Learning()
    costs = {(0, 0): 3.0, (1, 1): -5.0}
    assert jointly_gated(costs, frame, joint, doubtful=()) == costs
    assert joint.fixes == fixes[1:]
