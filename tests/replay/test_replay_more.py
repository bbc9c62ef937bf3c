"""Replays of damaged, divided and foreign recordings; exports by the command line."""

import bz2
import gzip
import json
import lzma
import os
import re
import subprocess
import sys
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from commands import run_command
from flying import CAMERA, LINK, Flight, fly

from fwav_companion.cli.main import main
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.line_types import TargetLine
from fwav_companion.replay import read_recording, replay
from fwav_companion.replay.driver import _drive
from sitl_mock import scenario

CONFIG = LINK + '[camera]\ncalibration = "camera.yaml"\n'


@pytest.fixture(scope="module")
def flown() -> Flight:
    return fly(scenario("unbiased").but({"seconds": 12.0, "seed": 6}))


class Site:
    def __init__(self, folder, flown):
        self.folder, self.flown = folder, flown
        self.write("flight.toml", CONFIG)
        self.write("camera.yaml", CAMERA)
        self.telemetry, self.detections = bytes(flown.companion.tlog), bytes(flown.companion.detections)

    def write(self, name, content):
        (self.folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())

    def replay(self, *words, telemetry=("telemetry.tlog",), detections=("detections.jsonl",)):
        return run_command(*self.words(words, telemetry, detections), folder=self.folder)

    def replay_apart(self, *words, stdout=subprocess.PIPE):
        """In a process of its own: what the standard output's descriptor does stays there."""
        command = [sys.executable, "-m", "fwav_companion", *self.words(words)]
        return subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, text=True, cwd=self.folder, timeout=120)

    def words(self, words, telemetry=("telemetry.tlog",), detections=("detections.jsonl",)):
        if "telemetry.tlog" in telemetry:
            self.write("telemetry.tlog", self.telemetry)
        if "detections.jsonl" in detections:
            self.write("detections.jsonl", self.detections)
        files = ["--telemetry", *telemetry, "--detections", *detections, "--config", "flight.toml"]
        return ["replay", *files, "--out", "targets.jsonl", *words]

    def targets(self):
        return (self.folder / "targets.jsonl").read_bytes()


@pytest.fixture
def site(tmp_path, flown):
    return Site(tmp_path, flown)


def test_invalid_lines_are_reported_with_their_place_and_the_rest_is_used(site):
    lines = site.detections.splitlines(keepends=True)
    offset = sum(map(len, lines[:3]))
    site.detections = b"".join([*lines[:3], b'{"time_unix": 17', b"\n", *lines[3:]])
    done = site.replay()
    assert done.returncode == 0
    assert f"detections.jsonl: line 4 at offset {offset} is not a frame" in done.stderr
    summary = json.loads(site.targets().splitlines()[-1])
    assert summary["dropped"]["malformed"] == 1
    assert summary["fixes"] == site.flown.companion.lines[-1].fixes


def test_nothing_recorded_is_no_answer_and_said(site):
    """A recording that was killed at once has empty files."""
    site.telemetry = site.detections = b""
    done = site.replay()
    assert (done.returncode, done.stderr) == (0, "detections.jsonl: no frame in it\ntelemetry.tlog: it is empty\n")
    assert json.loads(site.targets().splitlines()[-1])["fixes"] == 0


def test_who_reads_it_may_stop_reading(site):
    site.write("telemetry.tlog", site.telemetry)
    site.write("detections.jsonl", site.detections)
    words = ["--telemetry", "telemetry.tlog", "--detections", "detections.jsonl", "--config", "flight.toml"]
    command = [sys.executable, "-m", "fwav_companion", "replay", *words, "--out", "/dev/stdout"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=site.folder) as replayed:
        assert replayed.stdout.readline().startswith(b'{"type":"header"')
        replayed.stdout.close()
        assert (replayed.stderr.read(), replayed.wait(60)) == (b"", 141)


@pytest.mark.parametrize("stdout", ["-", "/dev/stdout"])
def test_targets_on_stdout_are_alone_there(site, stdout):
    reported = site.replay().stdout
    to_a_pipe = site.replay_apart("--out", stdout)
    assert (to_a_pipe.returncode, to_a_pipe.stderr) == (0, reported)
    assert to_a_pipe.stdout.encode() == site.targets()
    with (site.folder / "file").open("wb") as file:  # if it were opened again, it would begin at its first byte
        assert site.replay_apart("--out", stdout, "--report", "report", "--alone", stdout=file).returncode == 0
    assert (site.folder / "file").read_bytes() == site.targets()
    assert not (site.folder / "-").exists()


def test_targets_on_stdout_end_with_the_object_that_json_asks_for(site):
    reported = site.replay("--json")
    done = site.replay_apart("--json", "--out", "-")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.encode() == site.targets()
    assert json.loads(done.stdout.splitlines()[-1]) == json.loads(reported.stdout)


def test_a_file_that_is_called_by_a_dash_is_one(site):
    reported = site.replay().stdout
    assert site.replay("--out", "./-").stdout == reported
    assert (site.folder / "-").read_bytes() == site.targets()


@pytest.mark.timeout(10)
@pytest.mark.parametrize("option", ["--telemetry", "--detections", "--truth", "--config"])
@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("pipe", "Is a pipe, not a regular file; "),
        ("endless", "Is a device, not a regular file; "),
        ("ring", "Too many levels"),
    ],
)
def test_what_never_begins_or_never_ends_is_refused(site, monkeypatch, capsys, option, kind, said):
    """In this process: reading an endless file must reach the test's limit, not the machine's memory."""
    monkeypatch.chdir(site.folder)
    site.write("telemetry.tlog", site.telemetry)
    site.write("detections.jsonl", site.detections)
    os.mkfifo("pipe")
    Path("endless").symlink_to("/dev/zero")
    Path("ring").symlink_to("ring")
    words = {"--telemetry": "telemetry.tlog", "--detections": "detections.jsonl", "--config": "flight.toml"}
    words |= {"--out": "targets.jsonl", option: kind}
    assert main(["replay", *(word for pair in words.items() for word in pair)]) == 2
    reported = capsys.readouterr().err
    assert reported.startswith(f"fwav-companion: {kind}: {said}")
    assert "; accepted: " in reported
    assert reported.count("\n") == 1
    assert not Path("targets.jsonl").exists()


def test_an_output_in_a_ring_of_links_is_one_line_and_exit_2(site):
    (site.folder / "ring").symlink_to("ring")
    done = site.replay("--out", "ring")
    assert done.returncode == 2
    assert done.stderr == ("fwav-companion: ring: Too many levels of symbolic links; accepted: a writable file\n")


def test_damaged_telemetry_is_reported_with_its_place(site):
    site.telemetry = site.telemetry[:5000] + bytes(40) + site.telemetry[5000:]
    done = site.replay()
    assert done.returncode == 0
    assert "damaged bytes at offset" in done.stderr


def test_parts_of_one_recording_are_the_whole_again(site):
    telemetry, detections = site.telemetry, site.detections
    cut, line_end = frame_end(telemetry, len(telemetry) // 2), detections.index(b"\n", len(detections) // 2) + 1
    for name, data, at in (("a.tlog", telemetry, cut), ("a.jsonl", detections, line_end)):
        site.write(name, data[:at])
        site.write(name.replace("a", "b", 1), data[at:])
    done = site.replay(telemetry=("a.tlog", "b.tlog"), detections=("a.jsonl", "b.jsonl"))
    assert done.returncode == 0, done.stderr
    assert site.targets() == site.flown.companion.targets_file()


def test_a_part_that_breaks_off_costs_its_own_last_line_alone(site):
    detections = site.detections
    line_end = detections.index(b"\n", len(detections) // 2) + 1
    site.write("a.jsonl", detections[: line_end - 9])
    site.write("b.jsonl", detections[line_end:])
    done = site.replay(detections=("a.jsonl", "b.jsonl"))
    assert (done.returncode, done.stderr.count("is not a frame")) == (0, 1), done.stderr
    summary = json.loads(site.targets().splitlines()[-1])
    assert summary["frames"] == site.flown.companion.lines[-1].frames - 1


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (["--out", "telemetry.tlog"], "--telemetry"),
        (["--out", "./detections.jsonl"], "--detections"),
        (["--out", "flight.toml"], "--config"),
        (["--out", "camera.yaml"], "--config"),
        (["--out", "linked.jsonl"], "--detections"),
        (["--out", "truth.csv", "--truth", "truth.csv"], "--truth"),
        (["--export", "truth.csv", "--truth", "truth.csv"], "--truth"),
        (["--out", "a.kml", "--export", "a.kml"], "--out"),
    ],
)
def test_what_a_replay_reads_it_does_not_write_over(site, words, option):
    """A recording cannot be made a second time."""
    site.write("truth.csv", "label,north,east,down\ntarget,0,0,0\n")
    site.write("detections.jsonl", site.detections)
    (site.folder / "linked.jsonl").hardlink_to(site.folder / "detections.jsonl")
    before = {path.name: path.read_bytes() for path in site.folder.iterdir()} | {"telemetry.tlog": site.telemetry}
    done = site.replay(*words)
    assert done.returncode == 2
    assert f"{words[1]}: {option} names this file" in done.stderr
    assert {path.name: path.read_bytes() for path in site.folder.iterdir()} == before


def frame_end(data, beyond):
    at = 0
    while at < beyond:
        at += 8 + 12 + data[at + 9]
    return at


class Order:
    """A pipeline that only records the order of events."""

    time_offset_s = 0.0

    def __init__(self):
        self.came = []

    def on_message(self, message, _now):
        self.came.append(message.name)

    on_own_message = on_message

    def on_frame(self, frame, _now):
        self.came.append(frame.number)

    def assumed_arrival(self, frame):
        return frame.stamp_ns

    def finish(self, _now):
        self.came.append("end")


def test_at_equal_times_telemetry_comes_before_the_frame(flown):
    """Frames without an arrival time are assumed to arrive at their capture."""
    companion = flown.companion
    recording = read_recording(bytes(companion.tlog), b"", own_components(companion.config))
    times = sorted({unix_us for unix_us, _ in recording.messages})[100:110]
    lines = [json.dumps({"time_unix": at_us / 1e6, "frame": at_us, "detections": []}) for at_us in reversed(times)]
    recording = read_recording(bytes(companion.tlog), "\n".join(lines).encode(), own_components(companion.config))
    order, reported = Order(), [(unix_us, message.name) for unix_us, message in recording.messages]
    list(_drive(order, recording, own_components(companion.config)))
    expected = []
    for unix_us, name in reported:
        if times and unix_us > times[0]:
            expected.append(times.pop(0))
        expected.append(name)
    assert order.came == [*expected, "end"]


def test_another_vehicles_companion_does_not_set_our_clock(flown):
    """A swarm: (2, 191) asks for the time too, and is heard before we ask."""
    from mavlink_wire import Wire

    from fwav_companion.recording.tlog import tlog_record

    companion = flown.companion
    stranger = Wire(2, 191).frame("TIMESYNC", 0, 77_000_000_000)
    first_us = int.from_bytes(companion.tlog[:8], "big")
    data = tlog_record(first_us, stranger) + bytes(companion.tlog)
    recording = read_recording(data, bytes(companion.detections), own_components(companion.config))
    assert recording.unix_offset_ns == companion.unix_offset_ns
    assert list(replay(recording, companion.config, companion.calibration)) == companion.lines


def test_exports_stand_beside_the_targets(site):
    done = site.replay("--export", "t.kml", "--export", "t.geojson", "--export", "t.csv")
    assert done.returncode == 0, done.stderr
    assert site.targets() == site.flown.companion.targets_file()
    features = json.loads((site.folder / "t.geojson").read_text())["features"]
    assert len({feature["properties"]["track"] for feature in features}) >= 1
    rows = (site.folder / "t.csv").read_text().splitlines()
    assert len(rows) - 1 == sum(isinstance(line, TargetLine) for line in site.flown.companion.lines)
    assert site.replay("--export", "t.shp").returncode == 2


SHARES = "every u and v is between 0 and 1: they look like shares of the image's size; accepted: pixels"


def frames_of(site):
    return [line for line in site.detections.splitlines() if b'"detections"' in line]


def in_shares(line):
    frame = json.loads(line)
    for each in frame["detections"]:
        each["u"], each["v"] = each["u"] / 640.0, each["v"] / 480.0
    return json.dumps(frame).encode()


def test_detections_in_shares_of_the_image_are_named(site):
    site.write("shares.jsonl", b"\n".join(map(in_shares, frames_of(site))))
    done = site.replay(detections=["shares.jsonl"])
    assert done.stderr == f"shares.jsonl: {SHARES}\n"
    assert site.replay().stderr == ""


def test_frames_of_another_day_are_named_with_both_times(site):
    """Else the only answer is a reason for each frame, as that it came too late."""

    def later(line):
        frame = json.loads(line)
        return json.dumps({**frame, "time_unix": frame["received_unix"] + 86_400.0, "received_unix": None}).encode()

    frames = frames_of(site)
    site.write("later.jsonl", b"\n".join(map(later, frames)))
    done = site.replay(detections=["later.jsonl"])
    said = (
        rf"later\.jsonl: {len(frames)} of {len(frames)} frames came while there was no telemetry: frames from (.*) to "
    )
    (theirs, ours) = re.fullmatch(said + r".* UTC, telemetry from (.*) to .* UTC\n", done.stderr).groups()
    apart = datetime.fromisoformat(theirs) - datetime.fromisoformat(ours)
    assert abs(apart - timedelta(days=1)) < timedelta(seconds=5)


@pytest.mark.parametrize(("pack", "kind"), [(lzma.compress, "xz"), (gzip.compress, "gzip"), (bz2.compress, "bzip2")])
def test_a_compressed_recording_is_named_as_one(site, pack, kind):
    site.write("packed.tlog", pack(site.telemetry))
    done = site.replay(telemetry=["packed.tlog"])
    assert done.returncode == 2
    assert done.stderr == (
        f"fwav-companion: packed.tlog: compressed ({kind}); accepted: a .tlog, .bin or .ulg recording, unpacked\n"
    )
