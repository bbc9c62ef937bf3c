"""Association of fixes with targets: labels, the detector's own ids, shared errors, several targets in clutter."""

from collections import defaultdict

import numpy as np
import pytest
from draws import first_of
from handmade import a_fix, a_view
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0)


def ids_after(tracker, frames):
    for t, fixes in frames:
        tracks = tracker.on_frame(a_view(t, *fixes))
    return {t.id: t for t in tracks}


def test_labels_are_kept_apart_though_they_stand_together():
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    frames = [(k / 10, [a_fix(k / 10, (4, 3, 0), label=label) for label in ("person", "dog")]) for k in range(9)]
    tracks = ids_after(tracker, frames)
    assert [(t.id, t.label, t.fix.sighting.detection.label) for t in tracks.values()] == [
        (1, "person", "person"),
        (2, "dog", "dog"),
    ]


def test_the_detectors_ids_decide_where_places_do_not():
    """Two targets 0.3 m apart with 0.2 m of noise, distinguished by the detector only."""
    rng, tracker = np.random.default_rng(1), make_tracker(TrackingOptions(), NO_BIAS)
    seen = defaultdict(set)
    for k in range(60):
        fixes = [
            a_fix(k / 10, (4 + 0.3 * i + rng.normal() * 0.2, 3 + rng.normal() * 0.2, 0), detector_id=10 + i)
            for i in (0, 1)
        ]
        for track in tracker.on_frame(a_view(k / 10, *(fixes if k % 2 else fixes[::-1]))):
            seen[track.id].add(track.fix.sighting.detection.detector_id)
    assert sorted(map(sorted, seen.values())) == [[10], [11]]


def test_a_detectors_id_is_not_believed_across_the_field():
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    frames = [(k / 10, [a_fix(k / 10, (4, 3, 0), detector_id=5)]) for k in range(8)]
    tracks = ids_after(tracker, [*frames, (0.8, [a_fix(0.8, (40, 3, 0), detector_id=5)])])
    assert tracks[1].fix is None
    assert tracks[2].position_ned[0] == 40


def test_an_error_that_all_share_does_not_blur_who_is_who():
    """Two metres of height error move both targets alike: 1 m apart they are still two."""
    p = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, height=2.0)
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[0, Bias.HEIGHT] = 1.0
    rng, tracker = np.random.default_rng(2), make_tracker(TrackingOptions(), p)
    for k in range(40):
        fixes = [
            a_fix(k / 5, (4 + i + rng.normal() * 0.1, 3, 0), np.diag([0.01, 0.01, 0]), jacobian, p.bias_sigmas)
            for i in (0, 1)
        ]
        tracks = tracker.on_frame(a_view(k / 5, *fixes[:: 1 if k % 2 else -1]))
    assert len(tracks) == 2
    assert sorted(round(t.position_ned[0]) for t in tracks) == [4, 5]
    assert all(t.cov[0][0] > 3.9 for t in tracks)


@pytest.mark.parametrize("seed", first_of(3, 0, 1))
def test_three_targets_with_misses_and_clutter_keep_their_identity(seed):
    targets = ((2.0, 3.0), (6.0, 3.0), (4.0, 6.46))
    flight = Flight(
        seed=seed, seconds=50, targets=targets, velocities=((0, 0),) * 3, labels=("",) * 3, miss=0.1, clutter=0.1
    )
    tracker, nearest, last = make_tracker(TrackingOptions(), flight.priors), defaultdict(set), {}
    for view in World(flight).frames():
        for track in tracker.on_frame(view):
            if track.confirmed_host_ns is not None:
                distances = np.hypot(*(np.array(targets) - track.position_ned[:2]).T)
                nearest[track.id].add(int(distances.argmin()))
                last[track.id] = distances.min()
    assert sorted(map(sorted, nearest.values())) == [[0], [1], [2]]
    assert max(last.values()) < 0.1


def test_a_walker_is_followed():
    flight = Flight(seed=4, seconds=14, shape="hover", height_m=12.0, targets=((4.0, -5.0),), velocities=((0.5, 1.4),))
    errors, speeds = [], []
    tracker = make_tracker(TrackingOptions(motion="moving"), flight.priors)
    for view in World(flight).frames():
        t = view.frame / flight.fps
        for track in tracker.on_frame(view):
            if track.fix is not None and t > 3.0:
                errors.append(np.subtract(track.position_ned[:2], (4.0 + 0.5 * t, -5.0 + 1.4 * t)))
                speeds.append(np.subtract(track.velocity_ned[:2], (0.5, 1.4)))
    assert len(errors) > 100
    assert np.sqrt(np.mean(np.square(errors).sum(1))) < 0.3
    assert np.sqrt(np.mean(np.square(speeds).sum(1))) < 0.2
