"""The recorder writes everything it is given within its disk limits, and reports a failing disk once."""

import os
import shutil
import stat
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from report_lines import target

from fwav_companion.recording import folder as folder_module
from fwav_companion.recording.folder import (
    DETECTIONS,
    TARGETS,
    TELEMETRY,
    RecordingPlan,
    Space,
    SpaceError,
    SpacePolicy,
    lack_of_room,
    new_folder,
    recordings,
)
from fwav_companion.recording.line_types import HeaderLine
from fwav_companion.recording.lines import encode_line
from fwav_companion.recording.recorder import Recorder
from fwav_companion.recording.spans import AFTER_DISARMING_US

NO_LIMIT = SpacePolicy(0, 0, False)
START_US = 1_790_000_000_000_000
HEADER = HeaderLine(version="1", origin=None, unix_offset_s=0.0)
TARGET = target(0.0, 1.0, 2.0)


def plan(directory, **how):
    return RecordingPlan(**{"directory": directory, "sync_s": 0.05, "space": NO_LIMIT} | how)


def recorded(directory, *, reported=None, **how):
    """A closed recorder after one record of each kind."""
    reported = [] if reported is None else reported
    recorder = Recorder(plan(directory, **how), reported.append)
    recorder.start()
    recorder.telemetry(START_US, b"\xfd\x00")
    recorder.detection(START_US, b'{"a":1}\n')
    recorder.target(START_US, HEADER)
    recorder.target(START_US, TARGET)
    recorder.close(5.0)
    return recorder


def test_what_is_written_is_on_the_disk_after_close(tmp_path):
    recorded(tmp_path / "new" / "records", extra_files={"fwav-companion.toml": b"# x\n"})
    (folder,) = (tmp_path / "new" / "records").iterdir()
    assert (folder / TELEMETRY).read_bytes() == START_US.to_bytes(8, "big") + b"\xfd\x00"
    assert (folder / DETECTIONS).read_bytes() == b'{"a":1}\n'
    assert (folder / TARGETS).read_bytes() == encode_line(HEADER) + encode_line(TARGET)
    assert (folder / "fwav-companion.toml").read_bytes() == b"# x\n"


def test_a_recording_is_for_its_owner_and_group(tmp_path):
    usual = os.umask(0)
    try:
        recorded(tmp_path, extra_files={"fwav-companion.toml": b"# x\n"})
    finally:
        os.umask(usual)
    (folder,) = recordings(tmp_path)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o750
    assert {stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == {0o640}


def test_recordings_of_one_second_or_of_a_clock_that_went_back_stay_in_order(tmp_path, monkeypatch):
    for stem in ("20260921T101500Z", "19700101T000003Z", "19700101T000003Z"):
        monkeypatch.setattr(folder_module, "datetime", FrozenTime(stem))
        recorded(tmp_path)
    assert [path.name for path in recordings(tmp_path)] == [
        "00001-20260921T101500Z",
        "00002-19700101T000003Z",
        "00003-19700101T000003Z",
    ]


class FrozenTime:
    def __init__(self, stem):
        self._stem = stem

    def now(self, _zone):
        return self

    def strftime(self, _format):
        return self._stem


def test_what_is_written_reaches_the_disk_within_sync_s(tmp_path, monkeypatch):
    """The file's content when fdatasync was called: what a power cut would leave."""
    synced = []
    fdatasync = os.fdatasync

    def watched(descriptor):
        fdatasync(descriptor)
        synced.append(str(Path(f"/proc/self/fd/{descriptor}").readlink()))

    monkeypatch.setattr(os, "fdatasync", watched)
    recorder = Recorder(plan(tmp_path, sync_s=0.2), [].append)
    recorder.start()
    recorder.target(START_US, TARGET)
    while not synced:  # the test's own time limit ends a recorder that never does
        time.sleep(0.01)
    recorder.close(5.0)
    assert synced[0].endswith(TARGETS)


def test_a_directory_that_cannot_be_made_is_reported_once_and_at_once(tmp_path):
    (tmp_path / "file").write_text("")
    reported = []
    recorded(tmp_path / "file" / "records", reported=reported, when="armed")
    assert len(reported) == 1
    assert "recording stopped" in reported[0]
    assert str(tmp_path) in reported[0]


def test_what_it_does_or_waits_for_is_said_in_words(tmp_path):
    """The status file showed "None" before."""
    waits = 'waits for the vehicle to be armed ([record] when = "armed")'
    recorder = Recorder(plan(tmp_path, when="armed"), [].append)
    assert recorder.state == waits
    recorder.start()
    recorder.telemetry(START_US, b"\xfd\x00")
    assert recorder.state == waits
    recorder.on_armed(True, START_US)
    while recorder.state == waits:  # the test's own time limit ends the wait
        time.sleep(0.01)
    assert recorder.state == str(recordings(tmp_path)[0])
    recorder.on_armed(False, START_US)
    recorder.telemetry(START_US + AFTER_DISARMING_US, b"\xfd\x00")
    while recorder.state != waits:
        time.sleep(0.01)
    recorder.close(5.0)
    assert Recorder(plan(tmp_path), [].append).state == "waits for something to record"


@pytest.mark.parametrize("gone", ["folder", "directory"])
def test_a_recording_that_is_removed_is_reported_once(tmp_path, gone):
    """A removed file accepts bytes as before, but they can never be read."""
    reported = []
    recorder = Recorder(plan(tmp_path / "records"), reported.append)
    recorder.start()
    recorder.telemetry(START_US, b"\xfd\x00")
    while not list((tmp_path / "records").glob(f"*/{TARGETS}")):  # the test's own time limit ends the wait
        time.sleep(0.01)
    shutil.rmtree(tmp_path / "records" if gone == "directory" else recordings(tmp_path / "records")[0])
    while recorder.failure is None:
        recorder.telemetry(START_US, b"\xfd\x00")
        time.sleep(0.01)
    recorder.close(5.0)
    assert reported == [recorder.failure]
    assert str(tmp_path / "records") in reported[0]


def test_a_disk_without_room_says_so(tmp_path, monkeypatch):
    reported = []
    monkeypatch.setattr(folder_module.os, "statvfs", lambda _path: SimpleNamespace(f_bavail=0, f_frsize=4096))
    recorded(tmp_path, reported=reported)
    assert reported == ["recording stopped: 0.0 MB are free: the disk is full"]


@pytest.mark.parametrize("call", ["fdatasync", "fsync"])
def test_a_full_disk_stops_the_recording_and_nothing_else(tmp_path, monkeypatch, call):
    def full(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, call, full)
    reported = []
    recorder = recorded(tmp_path, reported=reported)
    assert len(reported) == 1
    assert "No space left on device" in reported[0]
    assert recorder.failure == reported[0]
    recorder.telemetry(START_US, b"later")


@pytest.mark.parametrize("when", ["always", "armed"])
def test_a_recording_goes_on_in_a_new_folder_when_there_is_room_again(tmp_path, monkeypatch, when):
    """A full disk once ended the recording in flight until the next start."""
    free_blocks = [0]
    monkeypatch.setattr(
        folder_module.os, "statvfs", lambda _path: SimpleNamespace(f_bavail=free_blocks[0], f_frsize=4096)
    )
    reported = []
    recorder = Recorder(plan(tmp_path, when=when, retry_s=0.01), reported.append, header=lambda: HEADER)
    recorder.start()
    recorder.on_armed(True, START_US)
    while recorder.failure is None:  # the test's own time limit ends the waits
        recorder.telemetry(START_US, b"\xfd\x00")
        time.sleep(0.001)
    free_blocks[0] = 1_000
    time.sleep(0.05)  # space for a second or two is not enough
    assert recorder.failure == "recording stopped: 4.1 MB are free, 20 are needed to go on"
    free_blocks[0] = 1_000_000
    while recorder.failure is not None:
        time.sleep(0.001)
    recorder.telemetry(START_US + 5, b"\xfd\x01")
    recorder.close(5.0)
    assert reported[0] == "recording stopped: 0.0 MB are free: the disk is full"
    assert reported[1:] == [f"recording continues in {tmp_path}"]
    folder = recordings(tmp_path)[-1]
    assert (folder / TELEMETRY).read_bytes() == (START_US + 5).to_bytes(8, "big") + b"\xfd\x01"
    assert (folder / TARGETS).read_bytes() == encode_line(HEADER)


def test_a_directory_that_may_not_be_written_does_not_look_like_room(tmp_path, monkeypatch):
    """As an existing directory on a card that the system mounted read-only: it has free bytes, too."""
    may = [False]
    monkeypatch.setattr(folder_module.os, "access", lambda _path, _mode: may[0])
    assert "may not be written" in lack_of_room(plan(tmp_path), 1)
    may[0] = True
    assert lack_of_room(plan(tmp_path), 1) == ""


def test_what_waits_for_a_hanging_disk_is_bounded(tmp_path):
    reported = []
    recorder = Recorder(plan(tmp_path, sync_s=1000.0), reported.append)  # never started: nothing is taken
    for _ in range(100):
        recorder.telemetry(START_US, bytes(1 << 20))
    assert len(reported) == 1
    assert "did not take 8 MiB" in reported[0]


def test_too_little_space_left_is_reported_and_makes_no_folder(tmp_path):
    reported = []
    recorded(tmp_path, reported=reported, space=SpacePolicy(0, 1 << 60, False))
    assert len(reported) == 1
    assert "[record] min_free_mb" in reported[0]
    assert list(tmp_path.iterdir()) == []


def old_recording(directory, size):
    folder = new_folder(directory)
    (folder / TELEMETRY).write_bytes(bytes(size))
    return folder


def test_at_the_limit_nothing_is_removed_unless_the_user_said_so(tmp_path):
    kept = [old_recording(tmp_path, 600), old_recording(tmp_path, 300)]
    reported = []
    recorded(tmp_path, reported=reported, space=SpacePolicy(900, 0, False))
    assert "[record] max_used_mb" in reported[0]
    assert recordings(tmp_path)[:2] == kept


def test_the_oldest_makes_room_where_that_is_allowed_and_each_is_reported(tmp_path):
    oldest, younger = old_recording(tmp_path, 600), old_recording(tmp_path, 300)
    (tmp_path / "mine").mkdir()
    reported = []
    recorded(tmp_path, reported=reported, space=SpacePolicy(920, 0, True))
    assert [str(oldest) in line for line in reported] == [True]
    assert not oldest.exists()
    assert younger.exists()
    assert (tmp_path / "mine").exists()
    assert len(recordings(tmp_path)) == 2


def test_the_recording_under_way_is_never_the_one_that_goes(tmp_path):
    current = old_recording(tmp_path, 600)
    with pytest.raises(SpaceError):
        Space(tmp_path, SpacePolicy(900, 0, True)).take(400, current)
    assert current.exists()


def test_room_that_was_made_meanwhile_is_used(tmp_path):
    current, old = old_recording(tmp_path, 100), old_recording(tmp_path, 700)
    room = Space(tmp_path, SpacePolicy(900, 0, False))
    (old / TELEMETRY).unlink()
    assert room.take(600, current) == []


class SteppedStop:
    """The recorder's stop event in time of its own: each wait ends at once, and the last one ends the recorder."""

    def __init__(self, ends_s: float) -> None:
        self.now_s, self._ends_s = 0.0, ends_s

    def wait(self, seconds: float) -> bool:
        self.now_s += seconds
        return self.now_s >= self._ends_s

    def set(self) -> None:
        self._ends_s = self.now_s


@pytest.mark.parametrize("room_s", [100.0, 101.3, 104.9, 107.7, 109.9])
def test_a_recording_resumes_by_itself_within_ten_seconds_of_room(tmp_path, monkeypatch, room_s):
    stop = SteppedStop(ends_s=150.0)
    full, roomy = (SimpleNamespace(f_bavail=blocks, f_frsize=4096) for blocks in (0, 1_000_000))
    monkeypatch.setattr(folder_module.os, "statvfs", lambda _path: full if stop.now_s < room_s else roomy)
    resumed_s = []
    recorder = Recorder(
        RecordingPlan(directory=tmp_path, space=NO_LIMIT),
        lambda _: None,
        on_news=lambda _: resumed_s.append(stop.now_s),
    )
    recorder._stop = stop
    recorder.telemetry(START_US, b"\xfd\x00")
    recorder._run()  # in this thread
    assert len(resumed_s) == 1
    assert 0.0 <= resumed_s[0] - room_s <= 10.0
    assert recorder.failure is None
