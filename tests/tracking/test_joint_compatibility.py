"""Joint compatibility: the displacements of all targets of a frame agree."""

import numpy as np
import pytest
from handmade import LEVEL, a_fix, a_view, host_ns
from simulated_flight import priors

from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.tracking.filters.base import SharedInnovation
from fwav_companion.tracking.joint_compatibility import CommonBiases, JointGate
from fwav_companion.types import BIAS_COUNT, Bias

SIDE_M = 1.5
"""Displacement by the height error from either side, one sigma, metres."""
ERRORS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, height=SIDE_M)
ROW = (0.0, 5.0, 10.0)
FAR = 60.0


def seen(t, easts, side, **detection):
    """A frame of targets on a line; the height error displaces them by SIDE_M times ``side``."""
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[1, Bias.HEIGHT] = side
    fixes = [
        a_fix(t, (3.0, east + SIDE_M * side, 0.0), LEVEL, jacobian, ERRORS.bias_sigmas, **detection) for east in easts
    ]
    return a_view(t, *fixes, sees=False)


def tracked():
    """A tracker of the row and a target far off, all seen from one side, and the ids by place."""
    tracker = make_tracker(TrackingOptions(), ERRORS)
    for k in range(75):
        tracks = tracker.on_frame(seen(k / 10, (*ROW, FAR), 1.0))
    return tracker, {round(track.position_ned[1] - SIDE_M): track.id for track in tracks}


def test_a_row_seen_from_the_other_side_is_not_exchanged_by_one_place():
    """From the other side each is 3 m off, and 2 m from its neighbour's place. The one far off shows which it is."""
    tracker, ids = tracked()
    tracks = tracker.on_frame(seen(12.0, (*ROW[1:], FAR), -1.0))
    found = {round(track.fix.position_ned[1] + SIDE_M): track.id for track in tracks if track.fix is not None}
    assert found == {place: ids[place] for place in (*ROW[1:], FAR)}


def test_a_row_that_is_displaced_from_one_frame_to_the_next_is_not_exchanged_either():
    """Steady tracks: all were seen a tenth of a second before."""
    tracker, ids = tracked()
    tracks = tracker.on_frame(seen(7.5, (*ROW[1:], FAR), -1.0))
    found = {round(track.fix.position_ned[1] + SIDE_M): track.id for track in tracks if track.fix is not None}
    assert found == {place: ids[place] for place in (*ROW[1:], FAR)}


def test_what_frames_before_showed_decides_for_a_lone_target():
    tracker, ids = tracked()
    tracker.on_frame(seen(12.0, (FAR, ROW[2]), -1.0))
    tracks = tracker.on_frame(seen(13.0, ROW[1:2], -1.0))
    assert [track.id for track in tracks if track.fix is not None] == [ids[5]]


def test_a_new_target_takes_no_track_that_the_displacement_excludes():
    """A fix at the place of a track, where all others are displaced by 3 m, is of another target."""
    tracker, ids = tracked()
    tracks = tracker.on_frame(seen(12.0, (3.0 + ROW[0], *ROW[1:], FAR), -1.0))
    (new,) = (track.id for track in tracks if track.fix is not None and track.id not in ids.values())
    assert new > max(ids.values())


class Displaced:
    """A target whose fixes have one innovation."""

    def __init__(self, found):
        self._found = found

    def innovation(self, fix):
        return self._found


def an_innovation(rng, count=3):
    shared = rng.normal(size=(2, count))
    root = rng.normal(size=(2, 2))
    (nn, ne), (_, ee) = root @ root.T + np.eye(2)
    north, east = rng.normal(size=2)
    return SharedInnovation(north, east, tuple(map(tuple, shared)), (nn, ne, ee))


def test_the_biases_are_those_of_a_kalman_filter():
    rng = np.random.default_rng(3)
    biases = CommonBiases.prior(3)
    mean, cov = np.zeros(3), np.eye(3)
    for _ in range(4):
        found = an_innovation(rng)
        d, (nn, ne, ee) = np.array(found.shared), found.noise
        noise = np.array([[nn, ne], [ne, ee]])
        rest = np.array([found.north_m, found.east_m]) - d @ mean
        expected = d @ cov @ d.T + noise
        nis = biases.gate(found, a_fix(0.0, (0.0, 0.0, 0.0))).nis
        assert nis == pytest.approx(rest @ np.linalg.solve(expected, rest))
        gain = cov @ d.T @ np.linalg.inv(expected)
        mean, cov = mean + gain @ rest, cov - gain @ d @ cov
        biases = biases.update(biases.residual(found))
        assert biases.mean == pytest.approx(mean)
        assert np.array(biases.cov) == pytest.approx(cov)


def test_biases_return_to_their_priors_and_wander_does_at_once():
    rng = np.random.default_rng(4)
    unknown = CommonBiases.prior(4).predict(host_ns(0.0))
    known = unknown.update(unknown.residual(an_innovation(rng, 4)))
    soon, late = known.predict(host_ns(1e-3)), known.predict(host_ns(200.0))
    assert np.array(soon.cov)[:2, :2] == pytest.approx(np.array(known.cov)[:2, :2], rel=1e-3)
    assert soon.mean == pytest.approx([*known.mean[:2], 0.0, 0.0], rel=1e-3)
    assert np.array(soon.cov)[2:] == pytest.approx(np.eye(4)[2:])
    assert np.abs(late.mean).max() < 1e-3
    assert np.array(late.cov) == pytest.approx(np.eye(4), abs=1e-3)


def test_a_pair_beyond_doubt_refutes_the_biases():
    fix, shared = a_fix(0.0, (0.0, 0.0, 0.0)), ((3.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    wrong, right = (Displaced(SharedInnovation(north, 0.0, shared, (0.04, 0.0, 0.04))) for north in (6.0, 0.0))
    for steady in (False, True):
        joint = JointGate(None)
        joint.learn(wrong, fix, steady=False)
        joint.learn(right, fix, steady=steady)
        assert joint.biases.mean[0] == 0.0 if steady else joint.biases.mean[0] > 0.9
