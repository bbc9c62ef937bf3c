"""Two tracks of one target become one; two targets stay two at any distance and any detection rate."""

from types import SimpleNamespace

import numpy as np
import pytest
from draws import first_of
from handmade import a_fix, a_view, host_ns
from msgspec.structs import replace
from simulated_flight import priors

from fwav_companion.geometry.stamps import NS_PER_S
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.self_calibrated import CalibratedTargetState
from fwav_companion.tracking.track_merging import TURNS, TrackMerging
from fwav_companion.tracking.track_state import initiate
from fwav_companion.types import Reason, TrackState

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0)
FPS = 30
NOISE_M = 0.2
ONE, OTHER, MIDDLE = (3.6, 3.0), (4.4, 3.0), (4.0, 3.0)
"""Two places closer together than single fixes of one target sometimes are."""


def flown(frames, fps=FPS, sees=True, **options):
    """All tracks after each frame; a frame is a list of (place, the detection's label and id)."""
    tracker, reported = make_tracker(TrackingOptions(**options), NO_BIAS), []
    for k, seen in enumerate(frames):
        fixes = [a_fix(k / fps, (*place, 0.0), **detection) for place, detection in seen]
        reported.append(tracker.on_frame(a_view(k / fps, *fixes, sees=sees)))
    return reported


def replaced(reported):
    """(id, id of the replacement) of all replaced tracks that were confirmed; branches of coasting ones never are."""
    tracks = (track for tracks in reported for track in tracks if track.confirmed_host_ns is not None)
    ends = [track for track in tracks if track.reason is Reason.REPLACED]
    return [(track.id, track.replaced_by) for track in ends]


def confirmed(reported):
    """Ids of the confirmed tracks after the last frame."""
    return [track.id for track in reported[-1] if track.confirmed_host_ns is not None and track.reason is None]


def scattered(rng, place):
    return tuple((np.array(place) + rng.normal(0.0, NOISE_M, 2)).tolist())


def both(one=None, other=None, frames=10, places=(ONE, OTHER)):
    """Frames that show two targets; ``one``, ``other``: their detections' labels and ids."""
    return [[(places[0], one or {}), (places[1], other or {})]] * frames


def one_target(rng, frames, kinds=({}, {})):
    """One detection a frame, between the two places; the name alternates between ``kinds``."""
    return [[(scattered(rng, MIDDLE), kinds[k % 2])] for k in range(frames)]


@pytest.mark.parametrize("motion", ["static", "moving"])
@pytest.mark.parametrize("seed", first_of(*range(3)))
def test_two_tracks_of_one_target_become_the_senior_one(seed, motion):
    reported = flown(both() + one_target(np.random.default_rng(seed), 12 * FPS), motion=motion)
    assert replaced(reported) == [(2, 1)]
    (end,) = (k for k, tracks in enumerate(reported) if any(track.replaced_by for track in tracks))
    assert end >= 10 + 3 * FPS - 1
    assert reported[end][0].fix is not None, "what was seen goes on with the other one"
    assert (reported[-1][0].id, reported[-1][0].replaces) == (1, (2,))


def test_the_one_that_was_confirmed_first_stays():
    """The track confirmed first stays, even if the other one was seen before it."""
    seldom, often = (4.6, 3.0), (3.4, 3.0)
    first = [[(seldom, {})], *([(often, {}), *([(seldom, {})] * (k % 2))] for k in range(20))]
    reported = flown([*first, *both(), *one_target(np.random.default_rng(0), 20 * FPS)])
    assert reported[0][0].id == 1
    assert replaced(reported) == [(1, 2)]


def test_three_tracks_of_one_target_become_one():
    three = [[*both()[0], ((4.0, 3.6), {})]] * 10
    reported = flown(three + one_target(np.random.default_rng(1), 30 * FPS))
    assert confirmed(reported) == [1]
    assert sorted(reported[-1][0].replaces) == [2, 3]


def test_a_slow_camera_takes_as_many_looks():
    reported = flown(both() + one_target(np.random.default_rng(0), 200), fps=1)
    assert replaced(reported) == [(2, 1)]
    assert sum(len(tracks) == 2 for tracks in reported) >= 10 + 60 - 1


def test_two_labels_are_two_targets():
    kinds = ({"label": "car"}, {"label": "person"})
    reported = flown(both(*kinds) + one_target(np.random.default_rng(0), 30 * FPS, kinds))
    assert confirmed(reported) == [1, 2]


def test_one_target_whose_detector_id_jumps_is_one():
    kinds = ({"detector_id": 7}, {"detector_id": 8})
    reported = flown(both(*kinds) + one_target(np.random.default_rng(0), 30 * FPS, kinds))
    assert confirmed(reported) == [1]


@pytest.mark.parametrize("motion", ["static", "moving"])
@pytest.mark.parametrize("share_fps", first_of((0.3, 10), (0.8, 30), (0.5, 30), (0.3, 30), (0.5, 10)))
def test_two_targets_that_are_seldom_seen_stay_two(share_fps, motion):
    share, fps = share_fps
    rng = np.random.default_rng(round(100 * share) + fps)
    seen = [[(place, {}) for place in (ONE, OTHER) if rng.random() < share] for _ in range(120 * fps)]
    reported = flown(both() + seen, fps, motion=motion)
    assert not replaced(reported)


@pytest.mark.parametrize("frames", first_of(7, 60, 15, 30, few=2))
def test_two_targets_that_hide_in_turns_stay_two(frames):
    """Both were detected for a second before: a track that was detected ten times does not outlive two seconds."""
    reported = flown(both(frames=FPS) + [[((ONE, OTHER)[k // frames % 2], {})] for k in range(40 * FPS)])
    assert confirmed(reported) == [1, 2]


@pytest.mark.parametrize("seed", first_of(*range(5), few=2))
def test_one_that_left_is_not_seen_rather_than_replaced(seed):
    """A target that left is reported as not seen, even if earlier frames missed both at times."""
    rng = np.random.default_rng(seed)
    seen = [[(place, {}) for place in (ONE, OTHER) if rng.random() < 0.8] for _ in range(8 * FPS)]
    reported = flown(both() + seen + [[(scattered(rng, ONE), {})] for _ in range(6 * FPS)])
    assert not replaced(reported)


def test_far_targets_that_take_turns_stay_two():
    far = (30.0, 3.0)
    reported = flown(both(places=(ONE, far)) + [[((ONE, far)[k % 2], {})] for k in range(20 * FPS)])
    assert confirmed(reported) == [1, 2]


def test_frames_that_could_not_see_the_other_say_nothing():
    reported = flown(both() + one_target(np.random.default_rng(0), 20 * FPS), sees=False)
    assert confirmed(reported) == [1, 2]


@pytest.mark.parametrize(
    ("apart_m", "sigma_m", "ends"),
    [(0.05, 0.02, True), (0.4, 0.2, False), (0.05, None, False), (0.1, 0.03, True), (0.1, 0.02, False)],
)
def test_slow_turns_are_of_one_target_where_calibration_puts_both_on_one_place(apart_m, sigma_m, ends):
    """Turns of twenty looks; a fix has a sigma of 0.2 m an axis. Their own filters are 0.8 m apart throughout.

    ``sigma_m``: one sigma of the two places' difference by calibration, north; None without calibration.
    """
    estimate = SimpleNamespace(separation2=lambda one, other: (apart_m / sigma_m) ** 2)
    calibrator = SimpleNamespace(passes=SimpleNamespace(served=SimpleNamespace(best=estimate)))

    def best(track):
        place = (4.0 + apart_m * (track.id == 2), 3.0)
        own = StaticKalman(NO_BIAS).initiate(a_fix(0.0, (*place, 0.0)))
        placed = SimpleNamespace(north=place[0], east=place[1])
        return own if sigma_m is None else CalibratedTargetState(calibrator, track.id, placed, own)

    merging = TrackMerging()
    for k in range(TURNS + 40):
        turn, now = k // 20 % 2, host_ns(k / FPS)
        tracks = [confirmed_track(1, ONE, now), confirmed_track(2, OTHER, now)]
        missed = tracks[1 - turn]
        life = replace(missed.life, misses=5 + k % 20)
        tracks[1 - turn] = replace(missed, fix=None, life=life)
        merging = merging.after_frame(tracks, [missed.id], NS_PER_S // FPS, lambda track: track.target)
    after = merging.merged(tracks, best)
    assert [track.life.reason is Reason.REPLACED for track in after] == [False, ends]


def confirmed_track(number, place, now):
    fix = a_fix(0.0, (*place, 0.0))
    track = initiate(number, fix, StaticKalman(NO_BIAS).initiate(fix), now)
    return replace(track, life=replace(track.life, state=TrackState.CONFIRMED, confirmed_ns=number))
