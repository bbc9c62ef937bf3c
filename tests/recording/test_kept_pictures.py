"""Pictures in a recording: with their stamps, within its space, and never at the cost of the flight's data."""

import json
import os
import time
from pathlib import Path

import pytest

from fwav_companion.recording import recorder as recorder_module
from fwav_companion.recording.folder import PICTURES, STAMPS, TELEMETRY, RecordingPlan, SpacePolicy, recordings
from fwav_companion.recording.recorder import Recorder

START_US = 1_790_000_000_000_000
NO_LIMIT = SpacePolicy(0, 0, False)


def recorder_of(directory, reported, **how):
    made = Recorder(RecordingPlan(**{"directory": directory, "sync_s": 0.02, "space": NO_LIMIT} | how), reported.append)
    made.start()
    return made


def put(recorder, number, size=1000):
    recorder.picture(f"{number:06d}.jpg", bytes([number]) * size, b'{"file":"%06d.jpg"}\n' % number)


def kept(folder):
    """(names in the stamps, names of the files)."""
    stamps = folder / STAMPS
    if not stamps.exists():
        return [], []
    named = [json.loads(line)["file"] for line in stamps.read_bytes().splitlines()]
    return named, sorted(path.name for path in (folder / PICTURES).glob("*.jpg"))


def test_pictures_lie_in_the_folder_of_the_flight_in_order(tmp_path):
    reported = []
    recorder = recorder_of(tmp_path, reported)
    recorder.telemetry(START_US, b"\xfd")
    for number in range(1, 6):
        put(recorder, number)
    recorder.close(5.0)
    (folder,) = recordings(tmp_path)
    names = [f"{number:06d}.jpg" for number in range(1, 6)]
    assert kept(folder) == (names, names)
    assert (folder / PICTURES / "000003.jpg").read_bytes() == b"\x03" * 1000
    assert (folder / PICTURES).stat().st_mode & 0o777 == 0o750
    assert reported == []


def test_a_picture_is_on_the_disk_before_its_stamp(tmp_path, monkeypatch):
    synced = []
    fdatasync = os.fdatasync

    def watched(descriptor):
        fdatasync(descriptor)
        synced.append(Path(f"/proc/self/fd/{descriptor}").readlink().name)

    monkeypatch.setattr(os, "fdatasync", watched)
    recorder = recorder_of(tmp_path, [])
    recorder.telemetry(START_US, b"\xfd")
    put(recorder, 1)
    recorder.close(5.0)
    assert synced.index("000001.jpg") < synced.index("stamps.jsonl")


def test_pictures_stop_before_the_space_ends_and_the_flight_goes_on(tmp_path):
    """Nine tenths of 100 kB are for pictures: 90 of 1000 bytes do not fit beside their stamps."""
    reported = []
    recorder = recorder_of(tmp_path, reported, space=SpacePolicy(100_000, 0, False))
    recorder.telemetry(START_US, b"\xfd")
    for number in range(1, 120):
        put(recorder, number)
    recorder.telemetry(START_US + 1, bytes(5000))
    recorder.close(5.0)
    (folder,) = recordings(tmp_path)
    named, files = kept(folder)
    assert named == files
    assert 80 < len(named) < 90
    assert (folder / TELEMETRY).stat().st_size > 5000
    (line,) = reported
    assert line.startswith("recording: no more pictures are kept, all else is: recordings take")
    assert recorder.failure is None


def test_pictures_are_kept_again_once_there_is_room(tmp_path):
    reported = []
    (tmp_path / "00001-20260101T000000Z").mkdir()
    old = tmp_path / "00001-20260101T000000Z" / TELEMETRY
    old.write_bytes(bytes(95_000))
    recorder = recorder_of(tmp_path, reported, space=SpacePolicy(100_000, 0, False), retry_s=0.01)
    recorder.telemetry(START_US, b"\xfd")
    put(recorder, 1)
    while not reported:  # the test's own time limit ends the waits
        time.sleep(0.005)
    old.unlink()
    folder, number = recordings(tmp_path)[-1], 1
    while not kept(folder)[0]:
        number += 1
        put(recorder, number % 250)
        time.sleep(0.02)
    recorder.close(5.0)
    assert len(reported) == 1


def test_no_picture_is_held_before_arming(tmp_path):
    """Half a minute of pictures would be the whole memory."""
    recorder = recorder_of(tmp_path, [], when="armed")
    recorder.telemetry(START_US, b"\xfd")
    put(recorder, 1)
    recorder.on_armed(True, START_US + 1)
    put(recorder, 2)
    recorder.close(5.0)
    (folder,) = recordings(tmp_path)
    assert kept(folder) == (["000002.jpg"], ["000002.jpg"])
    assert (folder / TELEMETRY).stat().st_size > 0


def test_pictures_that_a_slow_disk_does_not_take_are_left_out_once_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder_module, "MOST_PICTURE_BYTES", 2500)
    reported = []
    plan = RecordingPlan(directory=tmp_path, space=NO_LIMIT)
    recorder = Recorder(plan, reported.append)  # not started: nothing is taken
    recorder.telemetry(START_US, b"\xfd")
    for number in range(1, 6):
        put(recorder, number)
    recorder.telemetry(START_US + 1, bytes(100_000))
    assert len(reported) == 1
    assert "[record] pictures" in reported[0]
    assert recorder.failure is None
    recorder.start()
    recorder.close(5.0)
    (folder,) = recordings(tmp_path)
    assert kept(folder)[0] == ["000001.jpg", "000002.jpg"]
    assert (folder / TELEMETRY).stat().st_size > 100_000


@pytest.mark.parametrize("removes", [True, False])
def test_the_oldest_recording_makes_room_for_pictures_where_that_is_allowed(tmp_path, removes):
    (tmp_path / "00001-20260101T000000Z").mkdir()
    (tmp_path / "00001-20260101T000000Z" / TELEMETRY).write_bytes(bytes(90_000))
    recorder = recorder_of(tmp_path, reported := [], space=SpacePolicy(100_000, 0, removes))
    recorder.telemetry(START_US, b"\xfd")
    put(recorder, 1)
    recorder.close(5.0)
    assert len(kept(recordings(tmp_path)[-1])[0]) == removes
    assert ("removed the oldest" in reported[0]) is removes
