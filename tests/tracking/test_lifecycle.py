"""The life of a track: confirmation, deletion, and missed detections."""

import numpy as np
import pytest
from handmade import a_fix, a_view
from msgspec.structs import replace
from simulated_flight import priors

from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import Reason, TrackState

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0)


def fed(tracker, start, seconds, *, fps=10, seen=True, looks=True, **detection):
    out = []
    for k in range(round(seconds * fps)):
        t = start + k / fps
        out.append(tracker.on_frame(a_view(t, *([a_fix(t, (4, 3, 0), **detection)] if seen else []), sees=looks)))
    return out


def confirmed(label="target", **options):
    tracker = make_tracker(TrackingOptions(**options), NO_BIAS)
    fed(tracker, 0.0, 1.0, label=label)
    return tracker


def test_it_is_confirmed_by_five_sights():
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    states = [tracks[0].state for tracks in fed(tracker, 0.0, 0.7)]
    assert states == [TrackState.TENTATIVE] * 4 + [TrackState.CONFIRMED] * 3


def test_a_single_sight_ends_as_never_confirmed():
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    fed(tracker, 0.0, 0.1)
    reported = fed(tracker, 0.1, 1.0, seen=False)
    assert [(t.state, t.reason) for tracks in reported for t in tracks] == [
        (TrackState.TENTATIVE, None),
        (TrackState.TENTATIVE, None),
        (TrackState.DROPPED, Reason.NEVER_CONFIRMED),
    ]


def outcomes(pattern, fps=10):
    """State and reason of the first track after each frame; in the pattern s is a detection, . is none."""
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    reported = [fed(tracker, k / fps, 1 / fps, fps=fps, seen=letter == "s")[0] for k, letter in enumerate(pattern)]
    return [(tracks[0].state, tracks[0].reason) if tracks and tracks[0].id == 1 else None for tracks in reported]


@pytest.mark.parametrize(
    ("pattern", "state", "reason"),
    [
        ("s.s.s.s.s", TrackState.CONFIRMED, None),
        ("s..s.s.s.s", TrackState.CONFIRMED, None),
        ("s..s..s.s", TrackState.TENTATIVE, None),
        ("s..s..s.s.", TrackState.DROPPED, Reason.NEVER_CONFIRMED),
        ("s.......", None, None),
    ],
)
def test_five_of_ten_looks_confirm_it_and_four_do_not(pattern, state, reason):
    """A detector with a miss rate of one half shows a target five times in ten frames. Before the tenth frame a
    tentative track is deleted only after three misses in a row."""
    last = outcomes(pattern)[-1]
    assert last == (None if state is None else (state, reason))


def test_looks_that_see_nothing_end_it_after_three_seconds():
    reported = fed(confirmed(), 1.0, 5.0, seen=False)
    ends = [(round(k / 10, 1), t.reason) for k, tracks in enumerate(reported) for t in tracks if t.reason]
    assert ends == [(2.9, Reason.NOT_SEEN)]
    assert reported[0][0].state is TrackState.CONFIRMED
    assert reported[5][0].state is TrackState.COASTING
    assert reported[-1] == ()


def test_frames_that_could_not_see_do_not_count():
    tracker = confirmed()
    reported = fed(tracker, 1.0, 60.0, seen=False, looks=False, fps=5)
    assert reported[-1][0].state is TrackState.COASTING
    assert fed(tracker, 61.0, 0.1)[0][0].id == 1


@pytest.mark.parametrize(
    ("label", "beside_m", "lives"), [("target", 1.0, True), ("target", 6.0, False), ("person", 0.0, False)]
)
def test_a_target_that_is_seen_where_no_fix_can_be_had_is_not_given_up(label, beside_m, lives):
    """For example a ray that is too shallow. A detection in another direction, or of another kind, does not keep the
    track alive.
    """
    tracker = confirmed(label="target")
    toward = np.array([4.0 - beside_m, 3.0, 10.0]) / np.linalg.norm([4.0 - beside_m, 3.0, 10.0])
    sighting = a_fix(1.0, (4, 3, 0), label=label).sighting
    unplaced = replace(sighting, ray=replace(sighting.ray, direction=tuple(toward.tolist())))
    for k in range(100):
        tracks = tracker.on_frame(replace(a_view(1.0 + k / 10), unplaced=(unplaced,)))
    assert [track.state for track in tracks] == ([TrackState.COASTING] if lives else [])


def test_it_is_not_kept_for_ever():
    reported = fed(confirmed(), 1.0, 302.0, seen=False, looks=False, fps=1)
    assert [t.reason for tracks in reported for t in tracks if t.reason] == [Reason.NOT_SEEN_LONG]


def test_a_slow_camera_gives_up_by_looks_not_by_seconds():
    reported = fed(confirmed(), 2.0, 20.0, fps=1, seen=False)
    assert [k for k, tracks in enumerate(reported) for t in tracks if t.reason] == [
        14
    ]  # 15 missed detections 0.2 s apart


def test_drop_all_reports_every_track_once_and_uses_no_id_again():
    tracker = confirmed()
    (dropped,) = tracker.drop_all(Reason.ORIGIN_SET, a_view(1.0))
    assert (dropped.id, dropped.state, dropped.reason) == (1, TrackState.DROPPED, Reason.ORIGIN_SET)
    assert fed(tracker, 1.1, 0.1)[0][0].id == 2


@pytest.mark.parametrize("motion", ["static", "moving"])
def test_the_table_is_bounded(motion):
    tracker = make_tracker(TrackingOptions(motion=motion), NO_BIAS)
    for k in range(12):
        fixes = [a_fix(k / 10, (50.0 * i + 1000 * k, 3, 0)) for i in range(256)]
        tracks = tracker.on_frame(a_view(k / 10, *fixes))
        assert sum(t.state is not TrackState.DROPPED for t in tracks) <= 20
        assert {t.reason for t in tracks} <= {None, Reason.NEVER_CONFIRMED, Reason.TOO_MANY_TRACKS}


def test_a_full_table_of_believed_tracks_takes_no_newcomer():
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    for k in range(8):
        tracks = tracker.on_frame(a_view(k / 10, *[a_fix(k / 10, (50.0 * i, 3, 0)) for i in range(30)]))
    assert [t.id for t in tracks] == list(range(1, 21))


def test_what_is_remembered_does_not_blind_to_what_is_there():
    """With twenty confirmed tracks out of sight, a new track replaces the one unseen the longest."""
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    for k in range(8):
        tracker.on_frame(a_view(k / 10, *[a_fix(k / 10, (50.0 * i, 3, 0)) for i in range(20)]))
    for k in range(8, 12):  # track 3 alone is still seen for a while
        tracker.on_frame(a_view(k / 10, a_fix(k / 10, (100.0, 3, 0)), sees=False))
    reported = [tracker.on_frame(a_view(k / 10, a_fix(k / 10, (5000.0, 3, 0)), sees=False)) for k in range(20, 30)]
    dropped = [(t.id, t.reason) for tracks in reported for t in tracks if t.state is TrackState.DROPPED]
    assert dropped == [(1, Reason.TOO_MANY_TRACKS)]
    (seen,) = (t for t in reported[-1] if t.state is TrackState.CONFIRMED)
    assert (seen.id, seen.position_ned[0]) == (21, pytest.approx(5000.0, abs=1.0))
