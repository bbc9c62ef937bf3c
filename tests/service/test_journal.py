"""The recording's state in the status file."""

from pathlib import Path

from fwav_companion.recording.folder import RecordingPlan
from fwav_companion.recording.recorder import Recorder
from fwav_companion.service.journal import Journal


def test_a_recording_that_waits_says_for_what_and_none_says_nothing(tmp_path: Path):
    recorder = Recorder(RecordingPlan(directory=tmp_path, when="armed"), [].append)
    assert Journal(recorder, clock=None).state == 'waits for the vehicle to be armed ([record] when = "armed")'
    assert Journal(None, clock=None).state is None
