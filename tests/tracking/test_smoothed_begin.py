"""The frame with which the smoother begins, where a late frame has earlier ones processed again."""

import smoothed_flights
from simulated_flight import Flight
from simulated_world import World
from smoothed_flights import tracked


def test_frames_that_came_too_early_for_the_telemetry_stay_without_an_answer_when_processed_again(monkeypatch):
    """Telemetry begins with the flight: the first frames have too little, which later telemetry does not change."""
    monkeypatch.setattr(smoothed_flights, "BEFORE_S", 0.0)
    world = World(Flight(seconds=2.0, fps=10.0, shape="hover", pitch_deg=0.0, targets=((0.5, 0.5),)))
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
