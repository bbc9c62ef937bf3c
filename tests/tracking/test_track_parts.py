"""Small parts of a track: adaptive noise, height, linearization point, turns of two tracks, looks, and the report."""

import numpy as np
import pytest
from handmade import a_fix, a_view, host_ns, vector
from msgspec.structs import replace
from scipy.spatial.transform import Rotation
from simulated_flight import priors

from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import Measurement
from fwav_companion.tracking.filters.gates import GATE
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.filters.linearization import LinearizationPoint, height_variance
from fwav_companion.tracking.filters.schmidt_kalman import DownEstimate
from fwav_companion.tracking.track_merging import ALTERNATING_NS, TURNS, AlternatingFixes
from fwav_companion.tracking.track_state import MOST_REPLACED, initiate, teaches
from fwav_companion.tracking.visibility import is_missed_detection
from fwav_companion.types import Reason, TrackState

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, height_noise_m=0.0)
PLACE = (4.0, 3.0, 0.0)


def fading_mean(values):
    """Means with a share of 1/n, and of one fiftieth once that is larger; the first fix of a target has none."""
    mean = 0.0
    for n, value in enumerate(values, 2):
        mean += max(1.0 / n, 0.02) * (value - mean)
    return mean


def test_adaptive_noise_is_the_fading_mean_of_what_exceeds_the_expectation():
    rng, noise = np.random.default_rng(2), AdaptiveNoise()
    squares, thrown = rng.uniform(0.5, 3.0, 80), rng.uniform(5.0, 6.0, 80)
    for distance2, thrown2 in zip(squares, thrown, strict=True):
        noise = noise.with_fix(distance2, 0.4, thrown2)
    assert noise.variance == pytest.approx(fading_mean(0.5 * (squares - 0.4)))
    assert noise.allowed == pytest.approx(fading_mean(0.5 * thrown))
    assert noise.count == 81


def test_adaptive_noise_is_limited_to_two_sigma_of_the_time_offset_and_to_nothing():
    assert AdaptiveNoise().with_fix(100.0, 0.4, 0.6).variance == pytest.approx(4.0 * 0.5 * 0.5 * 0.6)
    assert AdaptiveNoise().with_fix(0.1, 0.4, 0.6).variance == 0.0


@pytest.mark.parametrize(("count", "doubt"), [(1, 0.95), (10, 0.5), (18, 0.1), (19, 0.1), (500, 0.1)])
def test_the_prior_of_the_time_offset_fades_within_twenty_fixes_to_a_tenth(count, doubt):
    assert AdaptiveNoise(count=count).doubt == pytest.approx(doubt)


def level_fix(down, variance, shared):
    return Measurement((0.0, 0.0, down), np.diag([0.01, 0.01, variance]).tolist(), ((), (), shared), GATE)


def test_the_height_is_a_scalar_filter_that_considers_biases():
    before = DownEstimate(1.0, 0.09, (0.3, -0.2))
    after = before.update(level_fix(1.6, 0.03, (0.1, 0.4)))
    gain = 0.09 / (0.09 + 0.03)
    assert after.down_m == pytest.approx(1.0 + gain * 0.6)
    assert after.variance == pytest.approx(0.09 * (1.0 - gain))
    assert after.shared == pytest.approx((0.3 + gain * -0.2, -0.2 + gain * 0.6))
    given = before.update(level_fix(1.6, 0.03, (0.1, 0.4)), 0.5)
    assert given.variance == pytest.approx(0.25 * 0.09 + 0.25 * 0.03)
    assert given.shared == pytest.approx((0.2, 0.1))
    assert DownEstimate(1.0, 0.09, (0.0,)).update(level_fix(1.0, 0.03, (0.0,))).shared == (0.0,)


def test_the_mean_of_fixes_is_plain_at_first_and_forgets_over_seconds_later():
    point = LinearizationPoint(10.0, 0.0, (0.1, 0.0, 1.0), 0.0, 0.0)
    for k, offset in enumerate([1.0, 2.0, 6.0]):
        point = point.with_fix(10.0, offset, -offset, interval_s=1e-6, sigma_m=0.1)
        assert point.count == 2 + k
    assert (point.north_m, point.east_m) == pytest.approx((9.0 / 4, -9.0 / 4))
    later = point.with_fix(10.0, 0.0, 0.0, interval_s=0.7, sigma_m=0.1)
    assert later.north_m == pytest.approx(9.0 / 4 * np.exp(-1.0))


@pytest.mark.parametrize(("sigma_m", "interval_s", "variance"), [(0.3, 0.2, 0.09), (0.3, 0.05, 0.18), (0.0, 1.0, 4e-4)])
def test_heights_between_two_samples_repeat_them(sigma_m, interval_s, variance):
    assert height_variance(sigma_m, interval_s) == pytest.approx(variance)


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
    assert turns == AlternatingFixes(2, 300, looks=1)
    assert turns.with_look(100, fast=False).with_look(100, fast=False) == AlternatingFixes(looks=3)


def target():
    return StaticKalman(NO_BIAS).initiate(a_fix(0.0, PLACE))


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
    track = initiate(7, fix, StaticKalman(NO_BIAS).initiate(fix), host_ns(2.0))
    uneven = replace(track, last_fix=replace(fix, level_sigma_m=0.5))
    plain, level = track.report(track.target, a_view(2.0)), uneven.report(track.target, a_view(2.0))
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
    senior, junior = (initiate(k, a_fix(0.0, PLACE), target(), host_ns(0.0)) for k in (1, 900))
    for k in range(2, MOST_REPLACED + 4):
        senior, ended = senior.merged(initiate(k, a_fix(0.0, PLACE), target(), host_ns(0.0)))
        assert (ended.life.reason, ended.replaced_by) == (Reason.REPLACED, 1)
    assert senior.replaces == tuple(range(4, MOST_REPLACED + 4))
    both, _ = senior.merged(replace(junior, replaces=(77, 78)))
    assert both.replaces[-3:] == (77, 78, 900)
    assert len(both.replaces) == MOST_REPLACED


def test_only_fixes_of_a_known_height_in_a_world_with_a_position_teach_self_calibration():
    fix = a_fix(0.0, (1.0, 2.0, 0.0))
    assert teaches(fix)
    assert not teaches(replace(fix, sighting=replace(fix.sighting, relative=True)))
    assert not teaches(replace(fix, sighting=replace(fix.sighting, anchor_sigma_m=0.1)))
