"""The life of a track: confirmation and deletion by evidence, and missed detections."""

import numpy as np
import pytest
from draws import first_of, slow_of
from handmade import a_fix, a_view, host_ns
from msgspec.structs import replace
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.tracking.lifecycle import DELETED_LLR, KEPT_LOOKS, detected, initiated, not_detected
from fwav_companion.types import Reason, TrackState

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0)
PLACE = (4.0, 3.0, 0.0)


def fed(tracker, start, seconds, *, fps=10, seen=True, looks=True, **detection):
    out = []
    for k in range(round(seconds * fps)):
        t = start + k / fps
        out.append(tracker.on_frame(a_view(t, *([a_fix(t, PLACE, **detection)] if seen else []), sees=looks)))
    return out


def confirmed(label="target", seconds=3.0, **options):
    """A tracker with one confirmed target, detected in every frame until now."""
    tracker = make_tracker(TrackingOptions(**options), NO_BIAS)
    fed(tracker, 0.0, seconds, label=label)
    return tracker


def outcomes(pattern, fps=10):
    """State and reason of the first track after each frame; in the pattern s is a detection, . is none."""
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    reported = [fed(tracker, k / fps, 1 / fps, fps=fps, seen=letter == "s")[0] for k, letter in enumerate(pattern)]
    return [(tracks[0].state, tracks[0].reason) if tracks and tracks[0].id == 1 else None for tracks in reported]


@pytest.mark.parametrize("fps", [30, 1, 0.1, 1 / 30])
def test_three_detections_confirm_a_target_at_any_frame_rate(fps):
    states = [outcome[0] for outcome in outcomes("sssss", fps)]
    assert states == [TrackState.TENTATIVE] * 2 + [TrackState.CONFIRMED] * 3


@pytest.mark.parametrize(
    ("pattern", "state", "reason"),
    [
        ("s..s..s", TrackState.TENTATIVE, None),
        ("s.s.s", TrackState.CONFIRMED, None),
        ("s..s..s..s", TrackState.CONFIRMED, None),
        ("s...s...s...s", TrackState.CONFIRMED, None),
        ("s...", TrackState.TENTATIVE, None),
        ("s....", TrackState.DROPPED, Reason.NEVER_CONFIRMED),
        ("s.....", None, None),
    ],
)
def test_missed_detections_count_against_a_track_and_detections_for_it(pattern, state, reason):
    """At a detection probability of 0.7 a miss has a likelihood ratio of 0.3: four of them make 1 in 120."""
    assert outcomes(pattern)[-1] == (None if state is None else (state, reason))


def test_looks_in_vain_delete_a_target_after_three_seconds():
    reported = fed(confirmed(), 3.0, 5.0, seen=False)
    ends = [(k, t.reason) for k, tracks in enumerate(reported) for t in tracks if t.reason]
    assert ends == [(29, Reason.NOT_SEEN)]
    assert reported[0][0].state is TrackState.CONFIRMED
    assert reported[5][0].state is TrackState.COASTING
    assert reported[-1] == ()


def test_a_moving_target_that_is_hidden_for_five_seconds_stays_one_track():
    tracker = confirmed(label="", motion="moving")
    assert {track.state for track in fed(tracker, 3.0, 5.0, seen=False)[-1]} == {TrackState.COASTING}
    assert [(t.id, t.state) for t in fed(tracker, 8.0, 1.0)[-1]] == [(1, TrackState.CONFIRMED)]
    ends = [(k, t.reason) for k, tracks in enumerate(fed(tracker, 9.0, 8.0, seen=False)) for t in tracks if t.reason]
    assert ends == [(pytest.approx(57, abs=2), Reason.NOT_SEEN)]


def test_a_slow_camera_deletes_by_looks_not_by_seconds():
    reported = fed(confirmed(), 4.0, 20.0, fps=1, seen=False)
    assert [k for k, tracks in enumerate(reported) for t in tracks if t.reason] == [14]


def test_a_target_detected_a_few_times_is_deleted_sooner():
    def lasts(seconds):
        reported = fed(confirmed(seconds=seconds), seconds, 5.0, seen=False)
        return sum(bool(tracks) for tracks in reported)

    assert lasts(0.3) < lasts(0.6) <= lasts(3.0) == 30


def test_frames_that_could_not_see_do_not_count():
    tracker = confirmed()
    reported = fed(tracker, 3.0, 60.0, seen=False, looks=False, fps=5)
    assert reported[-1][0].state is TrackState.COASTING
    assert fed(tracker, 63.0, 0.1)[0][0].id == 1


@pytest.mark.parametrize(
    ("label", "beside_m", "lives"), [("target", 1.0, True), ("target", 6.0, False), ("person", 0.0, False)]
)
def test_a_target_that_is_seen_where_no_fix_can_be_had_is_not_missed(label, beside_m, lives):
    """For example a ray that is too shallow. A detection in another direction, or of another kind, does not keep the
    track alive.
    """
    tracker = confirmed(label="target")
    toward = np.array([4.0 - beside_m, 3.0, 10.0]) / np.linalg.norm([4.0 - beside_m, 3.0, 10.0])
    sighting = a_fix(3.0, PLACE, label=label).sighting
    unplaced = replace(sighting, ray=replace(sighting.ray, direction=tuple(toward.tolist())))
    for k in range(100):
        tracks = tracker.on_frame(replace(a_view(3.0 + k / 10), unplaced=(unplaced,)))
    assert [track.state for track in tracks] == ([TrackState.COASTING] if lives else [])


@pytest.mark.parametrize(("inside_m", "lives"), [(0.02, True), (1.0, False)])
def test_a_target_at_the_edge_of_the_image_is_not_missed(inside_m, lives):
    """After 30 fixes of 0.2 m each, one sigma is 0.05 m."""
    tracker = confirmed()
    for k in range(100):
        view = replace(a_view(3.0 + k / 10), could_see=lambda place: place[0] < PLACE[0] + inside_m)
        tracks = tracker.on_frame(view)
    assert [track.state for track in tracks] == ([TrackState.COASTING] if lives else [])


def test_it_is_not_kept_for_ever():
    reported = fed(confirmed(), 3.0, 302.0, seen=False, looks=False, fps=1)
    assert [t.reason for tracks in reported for t in tracks if t.reason] == [Reason.NOT_SEEN_LONG]


@pytest.mark.parametrize(("fps", "frames"), [(30, 60), (0.1, 30)])
def test_a_tentative_target_out_of_view_is_kept_for_two_seconds_or_thirty_frames(fps, frames):
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    fed(tracker, 0.0, 1 / fps, fps=fps)
    reported = fed(tracker, 1 / fps, (frames + 5) / fps, fps=fps, seen=False, looks=False)
    (end,) = (k for k, tracks in enumerate(reported) if tracks and tracks[0].reason is Reason.NEVER_CONFIRMED)
    assert end in range(frames - 1, frames + 2)


def test_drop_all_reports_every_track_once_and_uses_no_id_again():
    tracker = confirmed()
    (dropped,) = tracker.drop_all(Reason.ORIGIN_SET, a_view(3.0))
    assert (dropped.id, dropped.state, dropped.reason) == (1, TrackState.DROPPED, Reason.ORIGIN_SET)
    assert fed(tracker, 3.1, 0.1)[0][0].id == 2


def modelled(probability, false_per_frame, looks=400, seed=0):
    """The model after a flight with this detector and one target in view."""
    rng, model, misses = np.random.default_rng(seed), DetectorModel(), 0
    for k in range(looks):
        hit, misses = (1, misses) if rng.random() < probability else (0, misses + 1)
        taken = misses + 1 if hit else 0
        misses = 0 if hit else misses
        model = model.after_frame(host_ns(k / 10), detected=hit, looks=taken, false=int(rng.poisson(false_per_frame)))
    return model


@pytest.mark.parametrize(("probability", "false"), [(0.3, 0.1), (0.9, 3.0), (0.6, 0.5)])
def test_the_flight_shows_the_detectors_rates(probability, false):
    """One sigma of 400 looks: sqrt(p (1 - p) / 400) <= 0.025, and sqrt(false / 400)."""
    model = modelled(probability, false)
    assert model.detection_probability == pytest.approx(probability, abs=0.08)
    assert model.false_per_frame == pytest.approx(false, abs=0.02 + 3.0 * np.sqrt(false / 400))
    assert model.frames_hz == pytest.approx(10.0, rel=0.01)


def test_nineteen_looks_leave_the_prior_of_the_detection_probability():
    assert modelled(0.0, 0.0, looks=60).detection_probability == pytest.approx(0.7)
    assert modelled(1.0, 0.0, looks=19).detection_probability == pytest.approx(0.7)
    assert modelled(1.0, 0.0, looks=21).detection_probability > 0.9


def test_older_looks_fade():
    model = modelled(1.0, 0.0, looks=3000)
    for k in range(1500):
        model = model.after_frame(host_ns(300 + k / 10), detected=k % 2, looks=1, false=0)
    assert model.detection_probability == pytest.approx(0.5, abs=0.15)


def flown(flight):
    """(seconds that each track was confirmed or coasting, its least distance from the target) by id."""
    tracker, lives, distances = make_tracker(TrackingOptions(), flight.priors), {}, {}
    for view in World(flight).frames():
        for track in tracker.on_frame(view):
            if track.state in (TrackState.CONFIRMED, TrackState.COASTING):
                lives[track.id] = lives.get(track.id, 0.0) + 1.0 / flight.fps
                distance = float(np.hypot(*np.subtract(track.position_ned[:2], flight.targets[0])))
                distances[track.id] = min(distance, distances.get(track.id, np.inf))
    return lives, distances


GHOST_M = 1.5
"""Farther from the target no estimate of it gets."""


@pytest.mark.parametrize("miss", [0.1, 0.7])
@pytest.mark.parametrize("seed", first_of(*range(50), some=4))
def test_clutter_in_every_tenth_frame_confirms_no_ghost_and_the_target_is_one_track(seed, miss):
    lives, distances = flown(Flight(seconds=60.0, seed=seed, miss=miss, clutter=0.1))
    assert not [life for number, life in lives.items() if distances[number] > GHOST_M and life > 1.0]
    assert len([number for number in lives if distances[number] <= GHOST_M]) == 1


@pytest.mark.parametrize("photographs", [1, 2, 3])
def test_twenty_targets_in_the_first_photographs_are_no_evidence_of_false_detections(photographs):
    """One fix each is as likely a target as clutter; with a second one they are targets."""
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    for k in range(photographs):
        tracker.on_frame(a_view(10.0 * k, *(a_fix(10.0 * k, (20.0 * i, 3.0, 0.0)) for i in range(20))))
    model = tracker.snapshot().detector
    assert model.undecided == pytest.approx([10.0, 0.0, 0.0][photographs - 1], abs=0.1)
    assert model.false == 0.0


def test_false_detections_count_whole_once_they_were_looked_for_in_vain():
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    for k in range(40):
        tracker.on_frame(a_view(k / 10, a_fix(k / 10, (50.0 * k, 3.0, 0.0))))
    model = tracker.snapshot().detector
    assert model.false + model.undecided == pytest.approx(40.0, abs=3.0)


@pytest.mark.parametrize("miss", [0.1, 0.5])
@pytest.mark.parametrize("seed", slow_of(*range(10), few=2))
def test_three_false_detections_a_frame_hide_no_target(seed, miss):
    """The first second, in which their number is not known yet, may confirm a ghost."""
    lives, distances = flown(Flight(seconds=60.0, seed=seed, miss=miss, clutter=3.0))
    assert [life for number, life in lives.items() if distances[number] <= GHOST_M and life > 30.0]
    assert len([life for number, life in lives.items() if distances[number] > GHOST_M and life > 1.0]) <= 1


def test_fixes_displaced_from_a_missed_target_confirm_no_other():
    """Every second frame shows the target 1.5 m beside, five sigma: as a camera later than its prior does."""
    tracker = confirmed()
    for k in range(60):
        place = (PLACE[0] + (1.5 if k % 2 else 0.0), PLACE[1], 0.0)
        tracks = tracker.on_frame(a_view(3.0 + k / 10, a_fix(3.0 + k / 10, place, label="target")))
    assert [track.id for track in tracks if track.confirmed_host_ns is not None] == [1]


def test_a_target_beside_a_missed_one_is_confirmed_where_the_frame_shows_another_in_its_place():
    """An error that displaced the fix by 1.5 m would displace the other target too. Photographs at 2 Hz."""
    beside, other = (PLACE[0] + 1.5, PLACE[1], 0.0), (PLACE[0], PLACE[1] + 6.0, 0.0)
    tracker = make_tracker(TrackingOptions(), NO_BIAS)
    for k in range(40):
        places = [PLACE, other] if k < 20 or k % 2 else [beside, other]
        tracks = tracker.on_frame(a_view(k / 2, *(a_fix(k / 2, place, label="target") for place in places)))
    assert [track.id for track in tracks if track.confirmed_host_ns is not None] == [1, 2, 3]


def test_a_second_target_five_sigma_beside_is_confirmed():
    tracker = confirmed()
    for k in range(5):
        places = [PLACE, (PLACE[0] + 1.5, PLACE[1], 0.0)]
        tracks = tracker.on_frame(
            a_view(3.0 + k / 10, *(a_fix(3.0 + k / 10, place, label="target") for place in places))
        )
    assert [track.id for track in tracks if track.confirmed_host_ns is not None] == [1, 2]


def test_among_many_false_detections_a_target_that_half_of_the_frames_miss_is_confirmed():
    """Three false detections a frame ask for a score of 15, more than what 15 missed looks at it would delete."""
    life, model = initiated(host_ns(0)), modelled(0.5, 3.0)
    assert model.confirming_llr("") > DELETED_LLR - KEPT_LOOKS * np.log(0.5)
    for k in range(1, 80):
        at = host_ns(k / 30)
        if k % 2:
            life = not_detected(life, at, missed=True, moving=False, detector=model)
        else:
            life = detected(life, at, 3.0, model)
    assert life.state is TrackState.CONFIRMED
