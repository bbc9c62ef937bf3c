"""Whole flights by the smoother over terrain, with a rangefinder and on a gimbal."""

import pytest

from fwav_companion.recording.line_types import CalibrationLine, TargetLine
from sitl_mock import Simulation
from tests.accuracy.flights import plan_of, recording_of, replayed
from tests.accuracy.scores import Tracks

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("kind", "most_m"), [("terrain", 0.8), ("rangefinder", 0.25), ("gimbal", 0.25)])
def test_flight_is_placed_within_its_claims(kind, most_m, tmp_path):
    """Bounds are twice what the flight shows; the filters of single targets are 2.5, 1.2 and 0.5 m off."""
    plan = plan_of(kind, 1)
    recording = recording_of(plan, tmp_path)
    tracks = Tracks(Simulation(plan.options), plan.landmarks)
    for line in replayed(plan, recording, "third"):
        if isinstance(line, TargetLine | CalibrationLine):
            tracks.add(line)
    score = tracks.score(recording.in_view, recording.first_seen_s, cpu_s=0.0, seed=1)
    assert score.relative.rms_m < most_m
    assert score.relative.square < 6.0
    assert score.missed == 0
