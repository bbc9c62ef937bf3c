"""The recorder keeps what it is given, and a failing disk is told once."""

import os

from fwav_companion.recording.recorder import DETECTIONS, TARGETS, TELEMETRY, Recorder


def test_what_is_written_is_on_the_disk_after_close(tmp_path):
    recorder = Recorder(tmp_path, {"fwav-companion.toml": b"# x\n"}, sync_s=0.05, on_failure=lambda why: None)
    recorder.start()
    recorder.telemetry(1_790_000_000_000_000, b"\xfd\x00")
    recorder.write(DETECTIONS, b'{"a":1}\n')
    recorder.write(TARGETS, b'{"b":1}\n')
    recorder.write(TARGETS, b'{"b":2}\n')
    recorder.close(5.0)
    (folder,) = tmp_path.iterdir()
    assert (folder / TELEMETRY).read_bytes() == (1_790_000_000_000_000).to_bytes(8, "big") + b"\xfd\x00"
    assert (folder / DETECTIONS).read_bytes() == b'{"a":1}\n'
    assert (folder / TARGETS).read_bytes() == b'{"b":1}\n{"b":2}\n'
    assert (folder / "fwav-companion.toml").read_bytes() == b"# x\n"


def test_two_recordings_of_one_second_get_folders_of_their_own(tmp_path):
    for _ in range(2):
        recorder = Recorder(tmp_path, {}, sync_s=0.05, on_failure=lambda why: None)
        recorder.start()
        recorder.close(5.0)
    assert len(list(tmp_path.iterdir())) == 2


def test_a_directory_that_cannot_be_made_is_told_once(tmp_path):
    (tmp_path / "file").write_text("")
    told = []
    recorder = Recorder(tmp_path / "file" / "records", {}, sync_s=0.05, on_failure=told.append)
    recorder.start()
    recorder.close(5.0)
    recorder.telemetry(0, b"")
    assert len(told) == 1
    assert "recording stopped" in told[0]
    assert str(tmp_path) in told[0]


def test_a_full_disk_stops_the_recording_and_nothing_else(tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fdatasync", full)
    told = []
    recorder = Recorder(tmp_path, {}, sync_s=0.05, on_failure=told.append)
    recorder.start()
    recorder.write(TARGETS, b"{}\n")
    recorder.close(5.0)
    assert len(told) == 1
    assert "No space left on device" in told[0]
    recorder.write(TARGETS, b"{}\n")


def test_what_waits_for_a_hanging_disk_is_bounded(tmp_path):
    told = []
    recorder = Recorder(tmp_path, {}, sync_s=1000.0, on_failure=told.append)  # never started: nothing is taken
    for _ in range(100):
        recorder.write(TELEMETRY, bytes(1 << 20))
    assert len(told) == 1
    assert "did not take 8 MiB" in told[0]
