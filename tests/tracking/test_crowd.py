"""A detector that fails: a crowd of false detections from one frame to the next, and a crowd of true ones."""

from __future__ import annotations

from dataclasses import dataclass, field

import msgspec
import numpy as np
import pytest
from handmade import a_fix, a_view
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2
from simulated_flight import Flight, path, priors
from simulated_world import World

from fwav_companion.pipeline.crowd_notices import CrowdNotices
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.tracking.crowd import NO_CROWD, Crowd, LabelCrowd
from fwav_companion.types import Bias, NoticeCode, Track, TrackState

IMAGE_PX2 = 640.0 * 480.0
PRECISE = priors(
    time_offset=0.001, heading=0.005, mount_x=0.003, mount_y=0.003, mount_z=0.003, position_north=0.1,
    position_east=0.1, height=0.05, height_noise_m=0.02,
)  # fmt: skip
"""Small shared errors: a claim is mostly the detections' own noise, and a false association exceeds it."""
TRUE = (9.0, 0.5)
CALM_S = 2.0
ALIVE = {TrackState.CONFIRMED, TrackState.COASTING}


class FailingDetector(World):
    """Beside the true detections, from CALM_S on, as many false ones a frame, anywhere in the picture."""

    def __init__(self, flight: Flight, false: int) -> None:
        super().__init__(flight)
        self._false = false

    def _seen(self, capture):
        seen = super()._seen(capture)
        for k in np.nonzero(capture >= CALM_S)[0]:
            seen += [(k, uv, "person") for uv in self.rng.uniform([0, 0], [639, 479], (self._false, 2))]
        return seen


@dataclass
class Outcome:
    """The tracks of a flight."""

    confirmed: set[int] = field(default_factory=set)
    """Ids of all tracks that were ever confirmed."""
    squares: list[float] = field(default_factory=list)
    """Normalised square of the selected target's error relative to the vehicle, in each frame of the crowd."""
    fixes: int = 0
    """Number of frames of the crowd with a fix of the selected target."""
    crowd: Crowd = NO_CROWD


def flown(false: int, seconds: float, fps: float, *, seed: int, motion: str = "static") -> Outcome:
    flight = Flight(
        height_m=12.0, fps=fps, seconds=seconds, miss=0.1, priors=PRECISE, shape="hover", smooth_wander=True,
        targets=(TRUE,), labels=("person",),
    ).drawn(seed)  # fmt: skip
    world, outcome = FailingDetector(flight, false), Outcome()
    tracker = make_tracker(TrackingOptions(motion=motion), PRECISE, world.state_at)
    for k, view in enumerate(world.frames()):
        alive = [t for t in tracker.on_frame(msgspec.structs.replace(view, image_px2=IMAGE_PX2)) if t.state in ALIVE]
        outcome.confirmed |= {track.id for track in alive}
        if alive and k / fps >= CALM_S:
            outcome.squares.append(square(world, flight, alive[0], k / fps))
            outcome.fixes += alive[0].fix is not None
    outcome.crowd = tracker.crowd
    return outcome


def square(world: World, flight: Flight, track: Track, at_s: float) -> float:
    """Normalised square of the error of the target relative to the vehicle."""
    reported = world.autopilot.reported(np.array([at_s]))[1][0][:2]
    true = path(flight, np.array([at_s - flight.biases[Bias.TIME_OFFSET]]))[0][0][:2]
    error = np.array(track.apparent_ned[:2]) - reported - (np.array(TRUE) - true)
    return float(error @ np.linalg.solve(np.array(track.relative_cov)[:2, :2], error))


@pytest.mark.parametrize("motion", ["static", "moving"])
def test_the_onset_of_a_crowd_confirms_no_ghost_and_the_known_target_stays(motion):
    outcome = flown(250, 3.5, 12.0, seed=1, motion=motion)
    assert outcome.confirmed == {1}
    assert len(outcome.squares) == 18, "it was lost"
    assert np.mean(np.array(outcome.squares) < chi2(2).ppf(0.95)) >= 0.93
    assert outcome.crowd.is_crowded("person")
    assert not outcome.crowd.is_crowded("pad")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("false", "seconds", "fps", "motion"),
    [(255, 60.0, 6.0, "static"), (60, 20.0, 10.0, "static"), (20, 20.0, 10.0, "moving")],
)
def test_a_crowd_that_stays_confirms_no_ghost_and_the_claim_holds(false, seconds, fps, motion):
    outcome = flown(false, CALM_S + seconds, fps, seed=3, motion=motion)
    assert outcome.confirmed == {1}
    assert len(outcome.squares) >= 0.97 * seconds * fps
    assert outcome.fixes >= 0.4 * len(outcome.squares)
    assert np.mean(np.array(outcome.squares) < chi2(2).ppf(0.95)) >= 0.93


def test_sixty_standing_persons_that_come_into_view_at_once_are_confirmed():
    persons = tuple((2.6 * i - 6.5, 2.6 * j - 11.7) for i in range(6) for j in range(10))
    flight = Flight(
        height_m=30.0, fps=10.0, seconds=3.0, pitch_deg=0.0, flapping_deg=0.0, miss=0.1, priors=PRECISE, shape="hover",
        targets=persons, velocities=((0.0, 0.0),) * 60, labels=("person",) * 60, smooth_wander=True,
    ).drawn(2)  # fmt: skip
    world = World(flight)
    tracker, found, waited = make_tracker(TrackingOptions(), PRECISE, world.state_at), {}, False
    for k, view in enumerate(world.frames()):
        fixes = view.fixes[:1] if k < 8 else view.fixes  # before, the detector was blind
        view = msgspec.structs.replace(view, image_px2=IMAGE_PX2, fixes=fixes)
        for track in tracker.on_frame(view):
            if track.state in ALIVE:
                found[track.id] = track.position_ned[:2]
        waited |= tracker.crowd.is_crowded("person")
    assert len(found) == 60
    assert not waited
    distances = np.hypot(*(np.array(list(found.values()))[:, None] - np.array(persons)).T)
    assert distances[linear_sum_assignment(distances)].max() < 1.0


def test_a_crowd_of_one_label_leaves_the_confirmation_of_others():
    rng, tracker = np.random.default_rng(4), make_tracker(TrackingOptions(), PRECISE)
    for k in range(40):
        crowd = [a_fix(k / 20, (*rng.uniform(-4000, 4000, 2), 0.0), label="bird") for _ in range(100)]
        pad = [a_fix(k / 20, (3.0, 5.0, 0.0), label="pad")] if k >= 15 else []
        tracks = tracker.on_frame(a_view(k / 20, *crowd, *pad))
    assert tracker.crowd.is_crowded("bird")
    assert {track.label for track in tracks if track.state in ALIVE} == {"pad"}


def test_photographs_are_no_crowd():
    """Each shows other ground with forty animals."""
    tracker = make_tracker(TrackingOptions(), PRECISE)
    for k in range(6):
        tracker.on_frame(a_view(3.0 * k, *(a_fix(3.0 * k, (50.0 * i, 500.0 * k, 0.0)) for i in range(40))))
        assert tracker.crowd is NO_CROWD


def test_a_crowd_that_has_ended_is_forgotten():
    tracker, rng = make_tracker(TrackingOptions(), PRECISE), np.random.default_rng(5)
    for k in range(40):
        tracker.on_frame(a_view(k / 20, *(a_fix(k / 20, (*rng.uniform(-4000, 4000, 2), 0.0)) for _ in range(100))))
    assert tracker.crowd.is_crowded("")
    for k in range(40, 140):
        tracker.on_frame(a_view(k / 20, a_fix(k / 20, (3.0, 5.0, 0.0))))
    assert tracker.crowd is NO_CROWD


def test_targets_that_come_into_view_together_are_confirmed_as_early_as_one():
    """Eight beside two known ones: they were taken for clutter for one frame more, and self-calibration paid for it."""
    tracker, tracks = make_tracker(TrackingOptions(), PRECISE), ()
    places = [(10.0 * k, 5.0, 0.0) for k in range(10)]
    confirmed_at = {}
    for k in range(10):
        shown = places[:2] if k < 3 else places
        tracks = tracker.on_frame(a_view(k / 30, *(a_fix(k / 30, place) for place in shown)))
        for track in tracks:
            if track.state in ALIVE:
                confirmed_at.setdefault(track.id, k)
    assert sorted(confirmed_at.values()) == [2] * 2 + [5] * 8


def test_the_crowd_is_said_once_a_label():
    notices, crowd = CrowdNotices(), Crowd({"person": LabelCrowd(200.0, 150.0, 199.6, 140.0), "pad": LabelCrowd(9, 9)})
    (notice,) = notices.notices(crowd)
    assert notice.code is NoticeCode.CROWDED
    assert "200 detections" in notice.text
    assert '"person"' in notice.text
    assert notices.notices(crowd) == []
