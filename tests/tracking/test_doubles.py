"""Two tracks of one target become one; two targets stay two, however near they are and however seldom seen."""

import numpy as np
import pytest
from handmade import a_fix, a_view
from simulated_flight import priors

from fwav_companion.nouns import Reason
from fwav_companion.tracking import TrackingOptions, make_tracker

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0)
FPS = 10
NOISE_M = 0.2
ONE, OTHER, MIDDLE = (3.6, 3.0), (4.4, 3.0), (4.0, 3.0)
"""Nearer to each other than single fixes of one target are at times."""


def flown(frames, **options):
    """All tracks after each frame; a frame: where something is seen, and as what."""
    tracker, told = make_tracker(TrackingOptions(**options), NO_BIAS), []
    for k, seen in enumerate(frames):
        fixes = [a_fix(k / FPS, (*place, 0.0), label=label) for place, label in seen]
        told.append(tracker.on_frame(a_view(k / FPS, *fixes)))
    return told


def scattered(rng, place):
    return tuple((np.array(place) + rng.normal(0.0, NOISE_M, 2)).tolist())


def one_target_seen_as_two(rng, seconds, labels=("", "")):
    """A second of both, as a detector that is not sure has it, then one detection a frame, between the two."""
    both = [[(ONE, labels[0]), (OTHER, labels[1])]] * FPS
    return both + [[(scattered(rng, MIDDLE), labels[k % 2])] for k in range(seconds * FPS)]


@pytest.mark.parametrize("motion", ["static", "moving"])
@pytest.mark.parametrize("seed", range(3))
def test_two_tracks_of_one_target_become_the_older_one(seed, motion):
    told = flown(one_target_seen_as_two(np.random.default_rng(seed), 8), motion=motion)
    ended = [(k, track) for k, tracks in enumerate(told) for track in tracks if track.reason is Reason.REPLACED]
    assert [(track.id, track.replaced_by) for _, track in ended] == [(2, 1)]
    assert FPS + 30 - 1 <= ended[0][0] <= FPS + 50
    assert [track.id for track in told[-1]] == [1]


def test_what_has_another_name_is_another_target():
    told = flown(one_target_seen_as_two(np.random.default_rng(0), 30, ("car", "person")))
    assert [track.id for track in told[-1]] == [1, 2]


def test_a_slow_camera_takes_as_many_looks():
    frames = one_target_seen_as_two(np.random.default_rng(0), 8)
    tracker, ends = make_tracker(TrackingOptions(), NO_BIAS), []
    for k, seen in enumerate(frames):
        tracks = tracker.on_frame(a_view(float(k), *[a_fix(float(k), (*place, 0.0)) for place, _ in seen]))
        ends += [k for track in tracks if track.reason is Reason.REPLACED]
    assert len(ends) == 1
    assert FPS + 30 - 1 <= ends[0] <= FPS + 50


@pytest.mark.parametrize("seed", range(3))
def test_two_targets_that_are_seen_half_of_the_time_stay_two(seed):
    rng = np.random.default_rng(seed)
    frames = [[(ONE, ""), (OTHER, "")]] * FPS
    frames += [[(place, "") for place in (ONE, OTHER) if rng.random() < 0.5] for _ in range(60 * FPS)]
    told = flown(frames)
    assert [track.id for track in told[-1]] == [1, 2]


def test_a_target_that_hides_is_not_replaced_by_a_far_one():
    far = (30.0, 3.0)
    told = flown([[(ONE, ""), (far, "")]] * FPS + [[(far, "")]] * (5 * FPS))
    assert [track.reason for tracks in told for track in tracks if track.reason] == [Reason.NOT_SEEN]
