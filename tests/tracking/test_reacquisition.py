"""Re-acquisition of a coasting track: one fix in a wide gate begins a branch, and enough of them confirm it again."""

from math import log

import numpy as np
import pytest
from handmade import a_fix, a_view, host_ns
from msgspec.structs import replace
from scipy.stats import chi2, multivariate_normal
from simulated_flight import priors

from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.tracking.lifecycle import Life, continued
from fwav_companion.types import BIAS_COUNT, Bias, Reason, TrackState

NO_BIAS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0)
CROOKED = priors(time_offset=0, heading=0, mount_x=0.2, mount_y=0.2, mount_z=0)
PLACE, ASTRAY = (4.0, 3.0, 0.0), (7.0, 1.0, 0.0)
SEEN_S, FPS = 3.0, 10
PIXEL2_M2 = 0.0015**2 * 125.0**1.5 / 10.0
"""Ground that a pixel of ``a_fix`` covers, 11.2 m away at PLACE from a height of 10 m."""
IMAGE_PX2 = 640.0 * 480.0


def branches(tracker):
    """The live branches, which are not reported."""
    return [track for track in tracker.snapshot().alive if track.branch_of]


class Flown:
    """A tracker with one confirmed track of id 1, and its reports of the newest frame by id."""

    def __init__(self, motion="moving"):
        self.tracker, self.t, self.tracks = make_tracker(TrackingOptions(motion=motion), NO_BIAS), 0.0, {}
        for _ in range(round(SEEN_S * FPS)):
            self.frame(PLACE)

    def frame(self, *places, sees=True):
        fixes = [a_fix(self.t, place) for place in places]
        self.tracks = {track.id: track for track in self.tracker.on_frame(a_view(self.t, *fixes, sees=sees))}
        self.branches = branches(self.tracker)
        self.t += 1.0 / FPS
        return self

    def coasted(self, seconds):
        """The flight after frames that do not cover the target."""
        for _ in range(round(seconds * FPS)):
            self.frame(sees=False)
        return self


def test_one_fix_in_a_wide_gate_begins_a_branch_and_the_track_coasts_on():
    flown, without = Flown().coasted(4.0).frame(ASTRAY), Flown().coasted(4.0).frame()
    (track,), (branch,) = flown.tracks.values(), flown.branches
    assert (track.state, track.fix) == (TrackState.COASTING, None)
    assert (track.position_ned, track.cov) == (without.tracks[1].position_ned, without.tracks[1].cov)
    assert track.last_seen_host_ns == host_ns(SEEN_S - 1.0 / FPS)
    assert (branch.life.state, branch.branch_of, branch.confirmed) == (TrackState.TENTATIVE, 1, False)
    assert branch.fix is not None
    assert flown.tracker.unused_fixes == {Reason.WEAK_EVIDENCE: 1}
    assert branch.target.position_ned == pytest.approx(ASTRAY, abs=0.1), "the coasting state with this fix"


def test_a_branch_that_is_missed_is_deleted_and_has_changed_nothing():
    flown, without = Flown().coasted(4.0).frame(ASTRAY), Flown().coasted(4.0).frame()
    alive = []
    for _ in range(6):
        alive.append(len(flown.frame().branches))
        without.frame()
    assert (alive[0], alive[-1]) == (1, 0)
    assert list(flown.tracks) == [1]
    assert flown.tracks[1].cov == without.tracks[1].cov


def test_fixes_that_agree_confirm_the_track_again():
    flown = Flown()
    confirmed_ns = flown.tracks[1].confirmed_host_ns
    flown.coasted(4.0)
    states, unused = [], []
    for _ in range(4):
        flown.frame(PLACE)
        states.append(flown.tracks[1].state)
        unused.append(flown.tracker.unused_fixes.get(Reason.WEAK_EVIDENCE, 0))
    assert states == [TrackState.COASTING] * 2 + [TrackState.CONFIRMED] * 2
    assert unused == [1, 1, 0, 0]
    assert not flown.branches
    track = flown.tracks[1]
    assert (track.first_host_ns, track.confirmed_host_ns) == (host_ns(0.0), confirmed_ns)
    assert track.fix is not None
    assert track.cov[0][0] < 0.04
    assert list(flown.tracks) == [1]


def test_the_target_is_found_again_although_a_false_detection_came_first():
    flown = Flown().coasted(4.0).frame(ASTRAY)
    for _ in range(4):
        flown.frame(PLACE)
    assert flown.tracks[1].state is TrackState.CONFIRMED
    assert flown.tracks[1].position_ned == pytest.approx(PLACE, abs=0.1)


def test_the_other_branches_end_once_the_track_is_confirmed_again():
    flown = Flown().coasted(4.0).frame(ASTRAY)
    alive = [len(flown.frame(PLACE, ASTRAY).branches) for _ in range(8)]
    assert (max(alive), alive[-1]) == (2, 0)
    assert list(flown.tracks) == [1, 2], "ids without a gap: branches have none of their own"
    assert [track.state for track in flown.tracks.values()] == [TrackState.CONFIRMED] * 2
    assert flown.tracks[1].position_ned == pytest.approx(ASTRAY, abs=0.2), "the branch with more evidence"


def test_a_standing_target_and_a_track_in_a_narrow_gate_are_confirmed_again_at_once():
    assert Flown("static").coasted(60.0).frame(PLACE).tracks[1].state is TrackState.CONFIRMED
    assert Flown("moving").coasted(0.4).frame(PLACE).tracks[1].state is TrackState.CONFIRMED


def seen_from(side, t, place):
    """A fix that the mount displaces to the ``side``, 1 or -1: 2 m north and east (one sigma)."""
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[0, Bias.MOUNT_X] = jacobian[1, Bias.MOUNT_Y] = 10.0 * side
    return a_fix(t, place, jacobian=jacobian, sigmas=CROOKED.bias_sigmas)


@pytest.mark.parametrize(("fps", "expected"), [(10.0, 1), (4.5, 1), (3.5, 0), (0.25, 0)])
def test_a_standing_target_in_a_wide_gate_has_branches_where_frames_come_faster_than_it_coasts(fps, expected):
    tracker = make_tracker(TrackingOptions(), CROOKED)
    for k in range(12):
        tracker.on_frame(a_view(k / fps, seen_from(1, k / fps, PLACE)))
    for k in range(12, 18):
        tracker.on_frame(a_view(k / fps, sees=False))
    (track,) = tracker.on_frame(a_view(18 / fps, seen_from(-1, 18 / fps, ASTRAY)))
    assert len(branches(tracker)) == expected
    assert track.state is (TrackState.COASTING if expected else TrackState.CONFIRMED)


@pytest.mark.parametrize(("apart_m", "expected"), [(2.0, 0), (60.0, 1)])
def test_a_standing_target_beside_another_has_no_branches(apart_m, expected):
    """The gate is 8 m wide: its fix may be the other's."""
    tracker, other = make_tracker(TrackingOptions(), CROOKED), (PLACE[0], PLACE[1] + apart_m, 0.0)
    for k in range(12):
        tracker.on_frame(a_view(k / 10, seen_from(1, k / 10, PLACE), seen_from(1, k / 10, other)))
    for k in range(12, 18):
        tracker.on_frame(a_view(k / 10, sees=False))
    assert len(tracker.on_frame(a_view(1.8, seen_from(-1, 1.8, ASTRAY)))) == 2
    assert len(branches(tracker)) == expected


def test_a_branch_whose_coasting_track_ends_is_a_track_of_its_own():
    flown = Flown().coasted(4.0).frame(PLACE)
    flown.tracker.restore(replace(flown.tracker.snapshot(), alive=tuple(flown.branches)))
    assert [list(flown.frame(PLACE).tracks) for _ in range(3)] == [[2]] * 3
    assert flown.tracks[2].confirmed_host_ns == host_ns(flown.t - 2.0 / FPS), "with the evidence of the branch"
    assert flown.tracker.unused_fixes == {}


@pytest.mark.parametrize("seconds", [0.5, 0.8, 1.0, 1.5, 3.0])
def test_the_bound_is_the_likelihood_ratio_of_the_fix(seconds):
    """Density of the target over that of false detections; the fix is at the predicted place."""
    flown = Flown()
    model = flown.tracker.snapshot().detector
    track = flown.coasted(seconds).frame().tracks[1]
    noise = np.diag([0.04, 0.04])
    cov = np.array(track.relative_cov)[:2, :2] + noise
    false_per_m2 = model.false_per_frame / IMAGE_PX2 / PIXEL2_M2
    ratio = log(model.detection_probability * multivariate_normal([0.0, 0.0], cov).pdf([0.0, 0.0]) / false_per_m2)
    wide = np.linalg.det(cov) > 3.0**4 * np.linalg.det(noise)
    again = Flown().coasted(seconds).frame(track.position_ned).tracks[1].state is TrackState.CONFIRMED
    assert again == (not wide or ratio >= model.confirming_llr(""))


def test_a_reacquired_life_has_the_evidence_of_both():
    coasting = Life(TrackState.COASTING, host_ns(0.0), host_ns(3.0), 9.0, 30, 40, 5, host_ns(0.2))
    branch = Life(TrackState.CONFIRMED, host_ns(7.0), host_ns(7.2), 12.0, 3, 4, confirmed_ns=host_ns(7.2))
    assert continued(coasting, branch) == Life(
        TrackState.CONFIRMED, host_ns(0.0), host_ns(7.2), 12.0, 33, 40, confirmed_ns=host_ns(0.2)
    )


def claims_after_coasts(draws, *, false_per_frame):
    """Normalised squares of the place after a coast of six seconds with false detections about it, 30 frames/s."""
    squares = []
    for seed in range(draws):
        rng, tracker = np.random.default_rng(seed), make_tracker(TrackingOptions(motion="moving"), NO_BIAS)
        velocity = rng.normal(0.0, 0.7, 2)
        for k in range(270):
            t = k / 30.0
            truth = np.array([0.0, 0.0]) + velocity * t
            places = [truth + rng.normal(0.0, 0.2, 2)] if k < 90 and rng.random() < 0.9 else []
            places += [rng.uniform(-8.0, 8.0, 2) for _ in range(rng.poisson(false_per_frame))]
            view = a_view(t, *(a_fix(t, (*place, 0.0)) for place in places), sees=k < 90)
            tracks = [track for track in tracker.on_frame(view) if track.id == 1]
        if tracks:
            off = np.array(tracks[0].position_ned[:2]) - truth
            squares.append(off @ np.linalg.solve(np.array(tracks[0].cov)[:2, :2], off))
    return np.array(squares)


@pytest.mark.slow
def test_claims_after_a_coast_among_false_detections_hold():
    """Every tenth frame has a false detection. Straight on, a target is nearer than a claim that allows turns."""
    squares = claims_after_coasts(60, false_per_frame=0.1)
    assert len(squares) >= 50
    assert np.sum(squares > chi2(2).ppf(0.95)) <= 6
    assert np.sum(squares > chi2(2).ppf(0.999)) <= 1
