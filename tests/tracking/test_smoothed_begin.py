"""The first frames of the smoother: when it begins, what it then claims, and a late frame among them."""

import numpy as np
import pytest
import smoothed_flights
from scipy.stats import chi2
from simulated_flight import Flight
from simulated_world import World
from smoothed_flights import tracked

TARGET = (0.5, 0.5)
HOVER = {"seconds": 2.0, "fps": 10.0, "shape": "hover", "pitch_deg": 0.0, "targets": (TARGET,)}


def hover(**options):
    return World(Flight(**HOVER | options))


def test_frames_that_came_too_early_for_the_telemetry_stay_without_an_answer_when_processed_again(monkeypatch):
    """Telemetry begins after the first frames, which have none; later telemetry does not change that."""
    monkeypatch.setattr(smoothed_flights, "BEFORE_S", -0.45)
    world = hover()
    views = world.frames()
    first, snapshot, answered = None, None, []
    for tracker, tracks in tracked(world, views):
        snapshot = snapshot or tracker.snapshot()
        answered.append(bool(tracks))
        first = tracker
    assert answered == sorted(answered)
    begun = answered.index(True)
    assert 2 <= begun < 15
    first.restore(snapshot)
    again = [bool(first.on_frame(view)) for view in views[1:]]
    assert again == answered[1:]


@pytest.mark.parametrize("ahead_s", [0.03, 0.2])
def test_target_of_the_first_frame_is_answered_by_two_attitudes_and_a_position(monkeypatch, ahead_s):
    monkeypatch.setattr(smoothed_flights, "BEFORE_S", 0.0)
    monkeypatch.setattr(smoothed_flights, "AHEAD_S", ahead_s)
    _, tracks = next(iter(tracked(hover())))
    assert len(tracks) == 1


def test_claims_of_the_first_frames_hold_while_telemetry_begins(monkeypatch):
    """Drawn errors, a vehicle that shakes and wanders: the frames before slow rates are known."""
    monkeypatch.setattr(smoothed_flights, "BEFORE_S", 0.0)
    monkeypatch.setattr(smoothed_flights, "AHEAD_S", 0.06)
    squares = []
    for seed in range(24):
        flight = Flight(**HOVER | {"seconds": 0.5, "fps": 10.0}).drawn(seed)
        found = []
        for _, tracks in tracked(World(flight)):
            for track in tracks:
                error = np.subtract(track.position_ned[:2], TARGET)
                found.append(error @ np.linalg.solve(np.array(track.cov)[:2, :2], error))
        assert len(found) == 5
        squares.append(np.mean(found))
    assert sum(squares) < chi2.ppf(0.999, 2 * len(squares))
