"""The smoothing tracker's own association: new, moving, turning and coasting targets, wrong mounts and delays."""

import msgspec
import numpy as np
import pytest
import simulated_world
from simulated_flight import Flight, priors
from simulated_world import World
from smoothed_flights import confirmed, tracked

from fwav_companion.self_calibration.calibration_report import CalibrationStatus, SharedParameter
from fwav_companion.tracking.motions import Motions
from fwav_companion.types import BIAS_COUNT, Bias, Reason, TrackState

MOVING = Motions(default=True)
HOVER = {"shape": "hover", "height_m": 10.0, "pitch_deg": 0.0, "fps": 10.0, "flapping_deg": 2.0}
TURN_S = 5.0


class TurningWorld(World):
    """A world whose targets turn round after five seconds."""

    def _places(self, target, velocity, capture):
        there = TURN_S - np.abs(capture - TURN_S)
        return np.stack([target[0] + velocity[0] * there, target[1] + velocity[1] * there, 0 * capture], -1)


def hover(world=World, **options):
    return world(Flight(**HOVER | {"seconds": 10.0} | options))


def test_two_targets_are_two_tracks_from_the_first_frames_on():
    places = ((1.0, 1.0), (-1.0, -1.0))
    world = hover(targets=places, velocities=((0.0, 0.0),) * 2, labels=("",) * 2, seconds=3.0)
    ever = set()
    for _, tracks in tracked(world):
        ever |= {track.id for track in confirmed(tracks)}
    assert len(ever) == 2
    found = sorted(track.position_ned[:2] for track in tracks)
    assert np.array(found) == pytest.approx(np.array(sorted(places)), abs=0.5)


def test_claims_hold_before_the_first_solve():
    world = hover(targets=((1.0, 1.0),), seconds=1.2)
    answers = []
    for tracker, tracks in tracked(world):
        answers += [(tracker._state.estimator.solves, track) for track in confirmed(tracks)]
    early = [track for solves, track in answers if not solves]
    assert early
    for track in early:
        error = np.subtract(track.position_ned[:2], (1.0, 1.0))
        assert error @ np.linalg.solve(np.array(track.cov)[:2, :2], error) < 13.8
        assert np.sqrt(track.cov[0][0]) < 3.0


@pytest.mark.parametrize("late_s", [-0.07, 0.07])
def test_claims_of_a_shaking_vehicle_with_a_late_camera_hold_before_the_first_solve(late_s):
    """A third of a beat: the delay's derivative alone claims 0.3 m where the place is wrong by more than a metre."""
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET] = late_s
    squares = []
    for seed in (1, 2):
        flight = Flight(**HOVER | {"height_m": 12.0, "fps": 30.0, "flapping_deg": 5.0}, seconds=1.6,
                        targets=((1.0, 1.0),), biases=biases, seed=seed)  # fmt: skip
        for tracker, tracks in tracked(World(flight)):
            for track in confirmed(tracks) if not tracker._state.estimator.solves else ():
                error = np.subtract(track.position_ned[:2], (1.0, 1.0))
                squares.append(error @ np.linalg.solve(np.array(track.cov)[:2, :2], error))
    assert len(squares) > 40
    assert np.mean(squares) < 4.0


def test_motion_is_that_of_the_label():
    world = hover(targets=((1.0, 1.0), (-1.0, -1.0)), velocities=((0.0, 0.0), (0.4, 0.0)), labels=("tree", "cow"),
                  seconds=4.0)  # fmt: skip
    for _, tracks in tracked(world, motions=Motions(by_label={"cow": True})):  # noqa: B007
        pass
    tree, cow = (next(track for track in tracks if track.label == label) for label in ("tree", "cow"))
    assert tree.velocity_ned is None
    error = np.subtract(cow.velocity_ned[:2], (0.4, 0.0))
    assert error @ np.linalg.solve(np.array(cow.velocity_cov)[:2, :2], error) < 13.8
    assert np.sqrt(cow.velocity_cov[0][0]) < 0.5


def test_walker_who_turns_round_keeps_the_track():
    world = hover(TurningWorld, targets=((-2.0, 0.0),), velocities=((0.9, 0.0),), fps=30.0, seconds=8.0)
    for _, tracks in tracked(world, motions=MOVING):  # noqa: B007
        pass
    (track,) = confirmed(tracks)
    assert track.first_host_ns < world.frames()[10].host_ns
    assert track.velocity_ned[0] == pytest.approx(-0.9, abs=0.4)


def hidden(views, begin, end, shown=()):
    """The frames without fixes from one to the other, but for those of the frames `shown`."""
    return [
        msgspec.structs.replace(view, fixes=()) if begin <= k < end and k not in shown else view
        for k, view in enumerate(views)
    ]


def test_coasting_walker_is_not_confirmed_again_by_one_detection():
    world = hover(targets=((-2.0, 0.0),), velocities=((0.3, 0.0),), fps=15.0, seconds=8.0)
    views = hidden(world.frames(), 45, 100, shown=(80,))
    states = []
    for _, tracks in tracked(world, views, motions=MOVING):
        first = [track for track in tracks if track.id == 1]
        states.append(first[0].state if first else None)
    assert states[44] is TrackState.CONFIRMED
    assert set(states[60:100]) == {TrackState.COASTING}
    assert states[-1] is TrackState.CONFIRMED, "several detections confirm it again, under its number"


@pytest.mark.parametrize("places", [((1.0, 1.0),)])
def test_target_that_may_move_teaches_once_it_was_still_for_long(places):
    world = hover(targets=places, seconds=9.0)
    taught = []
    for tracker, _ in tracked(world, motions=MOVING):
        kept = tracker._state.estimator.kept
        taught.append(0 if kept is None else len(kept))
    assert taught[50] == 0
    assert taught[-1] > 20


def test_walker_teaches_nothing():
    world = hover(targets=((-3.0, 0.0),), velocities=((0.6, 0.0),), seconds=10.0)
    for tracker, _ in tracked(world, motions=MOVING):  # noqa: B007
        pass
    assert tracker._state.estimator.solves == 0


def in_view(**options):
    """Twenty seconds of turns with three targets in view."""
    return Flight(fps=10.0, seconds=20.0, shape="turns", height_m=10.0, pitch_deg=0.0,
                  targets=((1.0, 2.0), (-1.5, 1.0), (2.0, -2.0)), velocities=((0.0, 0.0),) * 3, labels=("",) * 3,
                  **options)  # fmt: skip


def turned_world(monkeypatch, a, b, c, d):
    """A world whose image is turned about its middle: pixel x' = a x + b y, y' = c x + d y."""
    straight = simulated_world.pixel_from_camera

    def turned(points):
        x, y = (straight(points) - (320, 240)).T
        return np.stack([320 + a * x + b * y, 240 + c * x + d * y], -1)

    world = World(in_view())
    monkeypatch.setattr(simulated_world, "pixel_from_camera", turned)
    return world, world.frames()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "turn"),
    [("upside down", (-1, 0, 0, -1)), ("90 degrees clockwise", (0, -1, 1, 0)),
     ("90 degrees counterclockwise", (0, 1, -1, 0))],
)  # fmt: skip
def test_turned_image_is_named_within_twenty_seconds_and_doubted(monkeypatch, name, turn):
    world, views = turned_world(monkeypatch, *turn)
    doubted = []
    for tracker, tracks in tracked(world, views):
        if tracker.calibration.mistake:
            doubted += confirmed(tracks)
    assert name in tracker.calibration.mistake
    assert tracker.calibration.status is CalibrationStatus.WAITING
    assert all(track.fix is None and np.sqrt(track.cov[0][0]) > 1.0 for track in doubted)


@pytest.mark.slow
def test_right_mount_is_not_called_a_mistake():
    for tracker, _ in tracked(World(in_view())):
        assert tracker.calibration.mistake == ""


@pytest.mark.slow
def test_delay_far_beyond_its_prior_is_named_within_twenty_seconds():
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET] = 0.07
    flight = in_view(biases=biases, priors=priors(time_offset=0.01))
    for tracker, _ in tracked(World(flight)):  # noqa: B007
        pass
    report = tracker.calibration
    assert SharedParameter.DELAY in {each.parameter for each in report.denied}
    assert report.time_offset_s == pytest.approx(0.07, abs=0.004)


def test_late_frame_gives_the_tracks_that_it_would_have_given_in_time():
    world = hover(targets=((1.0, 1.0),), seconds=2.0)
    views = world.frames()
    for tracker, _ in tracked(world, views[:12]):  # noqa: B007
        pass
    before = tracker.snapshot()
    in_time = [tracker.on_frame(view) for view in views[12:14]]
    tracker.restore(before)
    tracker.on_frame(views[13])
    tracker.restore(before)
    again = [tracker.on_frame(view) for view in views[12:14]]
    assert confirmed(in_time[-1])
    assert again == in_time


def test_dropped_tracks_are_reported_once_and_ids_go_on():
    world = hover(targets=((1.0, 1.0),), seconds=2.0)
    views = world.frames()
    for tracker, _ in tracked(world, views[:10]):  # noqa: B007
        pass
    dropped = tracker.drop_all(Reason.ORIGIN_SET, views[9])
    assert [track.reason for track in dropped] == [Reason.ORIGIN_SET]
    assert tracker.next_id > max(track.id for track in dropped)


def test_targets_of_ended_tracks_leave_the_live_filter():
    world = hover(targets=((1.0, 1.0),), seconds=7.0)
    views = world.frames()
    for tracker, tracks in tracked(world, hidden(views, 25, len(views))):  # noqa: B007
        pass
    assert not confirmed(tracks)
    live = tracker._state.estimator.live
    assert {int(number) for number in live.targets} <= {track.id for track in tracker._state.tracks} | {1}
    assert not live.others.at
