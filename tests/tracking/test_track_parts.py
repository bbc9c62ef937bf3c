"""Small parts of a track: turns of two tracks, looks, and the report."""

import numpy as np
import pytest
from handmade import a_fix, a_view, host_ns, vector
from msgspec.structs import replace
from plain_filters import PlainFilter
from scipy.spatial.transform import Rotation

from fwav_companion.tracking.filters.alternation import ALTERNATING_NS, TURNS, AlternatingFixes
from fwav_companion.tracking.live_track import MOST_REPLACED, new_track
from fwav_companion.tracking.visibility import is_missed_detection
from fwav_companion.types import Reason, TrackState

PLACE = (4.0, 3.0, 0.0)


def test_two_tracks_are_one_after_sixty_fast_turns_over_three_seconds():
    turns, each_ns = AlternatingFixes(), ALTERNATING_NS // TURNS
    for _ in range(TURNS - 1):
        turns = turns.with_look(each_ns, fast=True)
    assert not turns.are_one
    assert turns.with_look(each_ns, fast=True).are_one
    assert not AlternatingFixes(TURNS, ALTERNATING_NS - 1).are_one


def test_slow_turns_undo_as_many_fast_ones_and_in_the_end_all():
    turns = AlternatingFixes(3, 300)
    turns = turns.with_look(100, fast=False)
    assert turns == AlternatingFixes(2, 300)
    assert turns.with_look(100, fast=False).with_look(100, fast=False) == AlternatingFixes()


def target():
    return PlainFilter(moves=False).initiate(a_fix(0.0, PLACE))


@pytest.mark.parametrize(("beyond_m", "missed"), [(-0.05, False), (0.05, True)])
def test_a_look_covers_the_target_and_its_surroundings(beyond_m, missed):
    """One sigma of both axes is 0.28 m, and 0.5 m of margin are around it, to the south as the image ends there."""
    around_m = 0.5 * (np.sqrt(0.08) + 0.5)
    view = replace(a_view(1.0), could_see=lambda place: place[0] > PLACE[0] - around_m - beyond_m)
    assert is_missed_detection(view, "target", target(), 0.5) is missed
    assert is_missed_detection(view, "target", target(), None), "a tentative track needs its place alone"


@pytest.mark.parametrize(("off_deg", "missed"), [(9.5, False), (10.5, True)])
def test_a_sighting_without_a_fix_within_ten_degrees_may_be_the_target(off_deg, missed):
    sighting = a_fix(1.0, PLACE, label="target").sighting
    to_place = np.subtract(PLACE, sighting.camera_ned)
    across = np.cross(to_place, [0.0, 0.0, 1.0])
    turn = Rotation.from_rotvec(np.radians(off_deg) * across / np.linalg.norm(across))
    toward = turn.apply(to_place / np.linalg.norm(to_place))
    view = replace(a_view(1.0), unplaced=(replace(sighting, ray=replace(sighting.ray, direction=vector(toward))),))
    assert is_missed_detection(view, "target", target(), None) is missed


def test_what_no_frame_could_see_is_not_missed():
    assert not is_missed_detection(a_view(1.0, sees=False), "target", target(), None)


def test_a_report_has_the_targets_place_and_the_level_of_its_newest_fix():
    fix = a_fix(2.0, PLACE, detector_id=5)
    track, target = new_track(7, fix, host_ns(2.0), moving=False), PlainFilter(moves=False).initiate(fix)
    uneven = replace(track, last_fix=replace(fix, level_sigma_m=0.5))
    plain, level = track.report(target, a_view(2.0)), uneven.report(target, a_view(2.0))
    assert np.subtract(level.cov, plain.cov) == pytest.approx(np.diag([0.0, 0.0, 0.25]))
    assert np.subtract(level.relative_cov, plain.relative_cov) == pytest.approx(np.diag([0.0, 0.0, 0.25]))
    assert (plain.id, plain.label, plain.frame, plain.last_pixel) == (
        7,
        fix.sighting.detection.label,
        2000,
        (320.0, 240.0),
    )
    assert (plain.host_ns, plain.first_host_ns, plain.last_seen_host_ns) == (host_ns(2.0),) * 3
    assert (plain.state, plain.confirmed_host_ns, plain.position_ned) == (TrackState.TENTATIVE, None, PLACE)
    assert track.slant_m == pytest.approx(np.hypot(5.0, 10.0))
    assert track.detector_id == 5


def test_a_merged_track_keeps_the_latest_numbers_that_it_replaces():
    senior, junior = (new_track(k, a_fix(0.0, PLACE), host_ns(0.0), moving=False) for k in (1, 900))
    for k in range(2, MOST_REPLACED + 4):
        senior, ended = senior.merged(new_track(k, a_fix(0.0, PLACE), host_ns(0.0), moving=False))
        assert (ended.life.reason, ended.replaced_by) == (Reason.REPLACED, 1)
    assert senior.replaces == tuple(range(4, MOST_REPLACED + 4))
    both, _ = senior.merged(replace(junior, replaces=(77, 78)))
    assert both.replaces[-3:] == (77, 78, 900)
    assert len(both.replaces) == MOST_REPLACED
