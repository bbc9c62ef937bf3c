"""What the service adds to a recording: the state in the status file, and events between the frames."""

from pathlib import Path
from types import SimpleNamespace

from fwav_companion.recording.events import LateSolve, RecordingEnd, parse_event
from fwav_companion.recording.folder import RecordingPlan
from fwav_companion.recording.recorder import Recorder
from fwav_companion.service.journal import Journal


def test_a_recording_that_waits_says_for_what_and_none_says_nothing(tmp_path: Path):
    recorder = Recorder(RecordingPlan(directory=tmp_path, when="armed"), [].append)
    waits = 'waits for the vehicle to be armed ([record] when = "armed")'
    assert Journal(recorder, clock=None, solver=None).state == waits
    assert Journal(None, clock=None, solver=None).state is None


def test_late_solves_are_recorded_each_second_and_before_the_end():
    lines, late = [], [{2: 5}, {2: 7, 3: 1}]
    recorder = SimpleNamespace(detection=lambda at_us, line: lines.append((at_us, parse_event(line))))
    clock = SimpleNamespace(unix_us=lambda now: now // 1000)
    journal = Journal(recorder, clock, solver=SimpleNamespace(take_late_frames=lambda: late.pop(0)))
    journal.tick(3_000_000_000)
    journal.end(4_000_000_000)
    assert lines == [
        (3_000_000, LateSolve(3.0, solve=2, frames=5)),
        (4_000_000, LateSolve(4.0, solve=2, frames=7)),
        (4_000_000, LateSolve(4.0, solve=3, frames=1)),
        (4_000_000, RecordingEnd(4.0)),
    ]
