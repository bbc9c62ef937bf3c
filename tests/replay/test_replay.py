"""A replay reproduces the flight to the byte; unreadable input is named."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from commands import run_command
from draws import first_of
from flying import CAMERA, LINK, Flight, fly

from fwav_companion.mavlink.wire.codec import Encoder
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.line_decoder import read_lines
from fwav_companion.recording.line_types import SightingLine, TargetLine
from fwav_companion.recording.lines import encode_line
from fwav_companion.recording.tlog import tlog_record
from fwav_companion.replay import read_recording, replay
from sitl_mock import scenario

CONFIG = LINK + '[camera]\ncalibration = "camera.yaml"\n'


def recorded(folder: Path, flown: Flight) -> list[str]:
    """Writes the flight's files to a folder; returns the arguments that replay them."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "flight.toml").write_text(CONFIG)
    (folder / "camera.yaml").write_text(CAMERA)
    (folder / "telemetry.tlog").write_bytes(flown.companion.tlog)
    (folder / "detections.jsonl").write_bytes(flown.companion.detections)
    names = {"telemetry": "telemetry.tlog", "detections": "detections.jsonl", "config": "flight.toml"}
    return [
        "replay",
        *(word for option, name in names.items() for word in (f"--{option}", str(folder / name))),
        *("--out", str(folder / "targets.jsonl")),
    ]


def elsewhere(*words: str, seed: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own, with another hash seed and another time zone."""
    environment = {**os.environ, "PYTHONHASHSEED": seed, "TZ": "Asia/Tokyo"}
    command = [sys.executable, "-m", "fwav_companion", *words]
    return subprocess.run(command, capture_output=True, text=True, env=environment, cwd=folder, timeout=120)


@pytest.fixture(scope="module")
def flown() -> Flight:
    return fly(scenario("three_targets").but({"seconds": 12.0, "seed": 11, "camera.late_every": 9}))


@pytest.mark.parametrize("name", first_of("late_frames", "rebooting", "default", "lossy_wire", "no_gps", "flow", few=2))
def test_replay_says_what_the_flight_said(name: str):
    flown = fly(scenario(name).but({"seconds": 16.0, "seed": 4}))
    companion = flown.companion
    recording = read_recording(bytes(companion.tlog), bytes(companion.detections), own_components(companion.config))
    assert list(replay(recording, companion.config, companion.calibration)) == companion.lines


@pytest.mark.parametrize("seconds", first_of(24.0, 600.0, some=0))
def test_a_long_flight_with_a_stepped_wall_clock_is_the_flight_again(seconds: float):
    options = scenario("stepped_wall_clock").but({"seconds": seconds, "seed": 4})
    steps = (*options.camera.wall_steps, (0.5 * seconds, -86_400.0 * 3), (0.75 * seconds, 0.25))
    companion = fly(options.but({"camera.wall_steps": steps})).companion
    recording = read_recording(bytes(companion.tlog), bytes(companion.detections), own_components(companion.config))
    replayed = b"".join(map(encode_line, replay(recording, companion.config, companion.calibration)))
    assert replayed == companion.targets_file()
    assert companion.lines[-1].dropped["across_clock_step"] >= 2


def test_the_same_input_gives_the_same_bytes_elsewhere_and_with_another_hash_seed(tmp_path, flown):
    first = elsewhere(*recorded(tmp_path / "a", flown), seed="1", folder=tmp_path / "a")
    second = elsewhere(*recorded(tmp_path / "a much longer" / "folder", flown), seed="77", folder=tmp_path)
    assert first.returncode == second.returncode == 0, first.stderr + second.stderr
    bytes_of_a_flight = flown.companion.targets_file()
    assert (tmp_path / "a" / "targets.jsonl").read_bytes() == bytes_of_a_flight
    assert (tmp_path / "a much longer" / "folder" / "targets.jsonl").read_bytes() == bytes_of_a_flight


def test_a_board_whose_clock_shows_1970_records_a_flight_that_replays(flown):
    companion = flown.companion
    shift_us = 1_790_000_000_000_000 - 60_000_000
    frames, at = bytearray(), 0
    data = bytes(companion.tlog)
    while at < len(data):
        length = 8 + 12 + data[at + 9]
        frames += (int.from_bytes(data[at : at + 8], "big") - shift_us).to_bytes(8, "big") + data[at + 8 : at + length]
        at += length
    lines = [json.loads(line) for line in companion.detections.splitlines()]
    for line in lines:
        for key in {"time_unix", "received_unix"} & line.keys():
            line[key] = round(line[key] * 1e6 - shift_us) / 1e6
    detections = "\n".join(map(json.dumps, lines)).encode()
    recording = read_recording(bytes(frames), detections, own_components(companion.config))
    targets = [
        line for line in replay(recording, companion.config, companion.calibration) if isinstance(line, TargetLine)
    ]
    originals = companion.targets()
    assert len(targets) == len(originals)
    for line, original in zip(targets, originals, strict=True):
        assert original.time_unix - line.time_unix == pytest.approx(shift_us / 1e6, abs=1e-6)
        assert (line.north, line.east, line.cov) == (original.north, original.east, original.cov)


def test_truth_adds_errors_to_the_summary(tmp_path, flown):
    truth = tmp_path / "truth.csv"
    rows = [flown.mock.world.place(target.at(0.0)) for target in flown.mock.scene]
    truth.write_text(
        "label,lat,lon,alt_amsl\n"
        + "".join(f"target,{place.lat!r},{place.lon!r},{place.alt_amsl!r}\n" for place in rows)
    )
    done = run_command(*recorded(tmp_path, flown), "--truth", str(truth), "--json", "--sightings", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout.splitlines()[-1])
    assert [target["state"] for target in summary["errors"]["targets"]] == ["found", "found", "found"]
    assert summary["errors"]["labels"]["target"]["state"] == "found"
    assert summary["errors"]["tracks"]["all"]["rms_m"] < 5.0
    lines = [json.loads(line) for line in (tmp_path / "targets.jsonl").read_text().splitlines()]
    assert lines[-1] == summary
    assert {"sighting", "target", "clock", "header", "summary"} == {line["type"] for line in lines}


def test_a_setting_changes_one_thing(tmp_path, flown):
    words = recorded(tmp_path, flown)
    assert run_command(*words, "--set", "tracking.filter=lowpass", folder=tmp_path).returncode == 0
    lines = [json.loads(line) for line in (tmp_path / "targets.jsonl").read_text().splitlines()]
    assert lines[0]["config"]["tracking"]["filter"] == "lowpass"
    lowpass = [line for line in lines if line["type"] == "target" and line["state"] == "confirmed"][-1]
    assert lowpass["north"] != flown.final().north


def test_frames_that_tell_no_arrival_are_taken_at_their_capture(flown):
    companion = flown.companion
    lines = [json.loads(line) for line in companion.detections.splitlines()]
    for line in lines:
        del line["received_unix"]
    detections = "\n".join(map(json.dumps, lines)).encode()
    recording = read_recording(bytes(companion.tlog), detections, own_components(companion.config))
    replayed = list(replay(recording, companion.config, companion.calibration))
    assert replayed[-1].fixes == companion.lines[-1].fixes
    assert "from_the_future" not in replayed[-1].dropped


def test_frames_on_the_autopilots_clock_are_taken_when_it_has_come_there(flown):
    """In whatever order the file has them."""
    companion, clock = flown.companion, flown.mock.clock
    lines = [line for line in map(json.loads, companion.detections.splitlines()) if "detections" in line]
    for line in lines:
        host_ns = round(line.pop("time_unix") * 1e9) - companion.unix_offset_ns
        line["time_boot"] = clock.boot_ns(host_ns) / 1e9
        del line["received_unix"]
    detections = "\n".join(map(json.dumps, reversed(lines))).encode()
    recording = read_recording(bytes(companion.tlog), detections, own_components(companion.config))
    replayed = list(replay(recording, companion.config, companion.calibration))
    assert replayed[-1].fixes > 0.95 * companion.lines[-1].fixes


@pytest.mark.slow
def test_frames_on_the_autopilots_clock_wait_for_the_clock_of_their_boot():
    """By the clock before the reboot they were captured long ago."""
    companion = fly(
        scenario("rebooting").but({"seconds": 16.0, "seed": 4, "camera.stamp_clock": "time_boot"})
    ).companion
    lines = [line for line in map(json.loads, companion.detections.splitlines()) if "detections" in line]
    for line in lines:
        del line["received_unix"]
    lines[60]["time_boot"] -= 3.0  # one out of order is late by itself, and holds up no other
    detections = "\n".join(map(json.dumps, lines)).encode()
    recording = read_recording(bytes(companion.tlog), detections, own_components(companion.config))
    replayed = list(replay(recording, companion.config, companion.calibration))
    assert replayed[-1].fixes > 0.95 * companion.lines[-1].fixes


def test_frames_after_the_telemetry_lack_an_attitude_and_do_not_crowd_each_other_out(flown):
    """More frames than the reorder window takes, an hour late by both their stamp and their arrival."""
    companion = flown.companion
    lines = [line for line in map(json.loads, companion.detections.splitlines()) if "detections" in line]
    later = [{**line, **{key: line[key] + 3600.0 for key in ("time_unix", "received_unix")}} for line in lines]
    detections = "\n".join(map(json.dumps, later)).encode()
    recording = read_recording(bytes(companion.tlog), detections, own_components(companion.config))
    summary = list(replay(recording, companion.config, companion.calibration))[-1]
    assert summary.frames == len(later) > 128
    assert summary.dropped.keys() == {"stale_attitude", "too_late"}, "every ninth frame of this camera is late"
    assert summary.dropped["stale_attitude"] > 0.85 * summary.detections


def test_two_vehicles_in_one_recording_are_named(flown):
    companion = flown.companion
    heartbeat = {"type": 2, "autopilot": 3, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
    other, first_us = Encoder(2, 1), int.from_bytes(companion.tlog[:8], "big")
    beats = [tlog_record(first_us, other.encode("HEARTBEAT", heartbeat)) for _ in range(3)]
    telemetry = b"".join(beats) + bytes(companion.tlog)
    recording = read_recording(telemetry, bytes(companion.detections), own_components(companion.config))
    (notice,) = list(replay(recording, companion.config, companion.calibration))[-1].notices
    assert (notice.code, notice.text.count("1, 2")) == ("several_autopilots", 1)


def test_monotonic_stamps_of_a_recording_are_refused_by_name(flown):
    companion = flown.companion
    detections = b'{"time_monotonic": 1003.5, "detections": [{"u": 1, "v": 2}]}\n'
    recording = read_recording(bytes(companion.tlog), detections, own_components(companion.config))
    assert list(replay(recording, companion.config, companion.calibration))[-1].dropped == {"no_monotonic_map": 1}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda folder: (folder / "telemetry.tlog").unlink(), "telemetry.tlog: No such file"),
        (lambda folder: (folder / "telemetry.tlog").write_bytes(b"text " * 99), "no MAVLink record"),
        (lambda folder: (folder / "detections.jsonl").unlink(), "detections.jsonl: No such file"),
        (
            lambda folder: (folder / "detections.jsonl").write_bytes(b"\n{}\nx\n"),
            "detections.jsonl: line 2 is not a frame (",
        ),
        (lambda folder: (folder / "camera.yaml").unlink(), "camera.yaml"),
        (lambda folder: (folder / "camera.yaml").write_text("model: pinhole\n"), "camera.yaml: "),
        (lambda folder: (folder / "flight.toml").write_text(CONFIG + "[tracking]\nfiltre = 1\n"), "filter"),
        (lambda folder: (folder / "targets.jsonl").mkdir(), "targets.jsonl: Is a directory"),
    ],
    ids=[
        "no telemetry",
        "no tlog",
        "no detections",
        "no frame",
        "no camera",
        "unknown camera",
        "unknown key",
        "out is a folder",
    ],
)
def test_a_wrong_file_is_one_line_and_exit_2(tmp_path, flown, change, said):
    words = recorded(tmp_path, flown)
    change(tmp_path)
    done = run_command(*words, folder=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_an_elevation_file_is_shifted_to_the_take_off_height_and_used(tmp_path):
    """A level model 8 m too high: after the shift it is the take-off surface, with the targets on it."""
    flown = fly(scenario("perfect").but({"seconds": 12.0, "seed": 2}), ("camera.readout_s=0.0",))
    words = recorded(tmp_path, flown)
    (tmp_path / "N48E011.hgt").write_bytes((527).to_bytes(2, "big") * 1201 * 1201)
    ground = '[ground]\nmodel = "terrain"\nterrain = ["N48E011.hgt"]\nterrain_datum = "egm96"\n'
    (tmp_path / "flight.toml").write_text(CONFIG + "readout_s = 0.0\n" + ground)
    done = run_command(*words, "--sightings", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = read_lines((tmp_path / "targets.jsonl").read_bytes().splitlines()).lines
    last = [line for line in lines if isinstance(line, TargetLine)][-1]
    assert flown.error_m(last) < 0.03
    assert last.alt_amsl == pytest.approx(519.0, abs=0.05)
    budgets = [line.budget for line in lines if isinstance(line, SightingLine) and line.budget]
    assert budgets
    assert all(budget.terrain > 0.5 for budget in budgets)


def test_a_ray_that_leaves_the_elevation_model_gives_no_fix_by_name(tmp_path, flown):
    words = recorded(tmp_path, flown)
    (tmp_path / "N10E010.hgt").write_bytes((500).to_bytes(2, "big") * 1201 * 1201)
    ground = '[ground]\nmodel = "terrain"\nterrain = ["N10E010.hgt"]\nterrain_datum = "egm96"\n'
    (tmp_path / "flight.toml").write_text(CONFIG + ground)
    done = run_command(*words, "--json", folder=tmp_path)
    summary = json.loads(done.stdout.splitlines()[-1])
    assert summary["fixes"] == 0
    assert summary["dropped"]["beyond_terrain"] > 100
