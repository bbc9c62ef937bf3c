"""Recorded and live files as inputs: targets files, recordings of the picture, the status of `run`."""

from __future__ import annotations

import asyncio
import json
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from math import cos, radians
from pathlib import Path

import msgspec
import pytest
from processes import process

pytest.importorskip("aiohttp")

from fwav_companion.cli.ground_inputs import WITHOUT_CONFIG, _judge
from fwav_companion.errors import InputFileError
from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.ground import replay_reader
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.picture_recorder import PictureRecorder
from fwav_companion.ground.replay_reader import ReplayReader
from fwav_companion.ground.status_reader import StatusReader
from fwav_companion.ground.views import TargetView
from fwav_companion.tools.doctor.run_status import run_status
from fwav_companion.types.flight_status import AutopilotReport, TrackReport
from fwav_companion.types.status import RunStatus

START = 1_790_000_000.0
LAT, LON = 48.1371999, 11.5756003
COV = [[4.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 1.0]]


def targets_file(path, seconds: int = 10) -> str:
    lines = [{"type": "header", "schema": 1, "version": "1", "unix_offset_s": 0.0, "config": {},
              "origin": {"lat": LAT, "lon": LON, "alt_amsl": 519.2}}]  # fmt: skip
    for second in range(seconds):
        north = float(second)
        lines.append(
            {"type": "target", "time_unix": START + second, "frame": None, "track": 2, "label": "person",
             "state": "confirmed", "north": 10.0, "east": 5.0, "down": 0.0, "lat": LAT + 10.0 / 111_200.0,
             "lon": LON, "alt_amsl": 519.2, "cov": COV, "fix": None,
             "relative": {"north": 10.0 - north, "east": 5.0, "down": 20.0, "cov": COV}}
        )  # fmt: skip
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return str(path)


def test_a_targets_file_is_played_by_its_own_clock(tmp_path):
    picture = GroundPicture()
    reader = ReplayReader(targets_file(tmp_path / "t.jsonl"), picture, speed=20.0)
    assert reader.now() == START
    reader.start()
    reader.tick(START + 4.5)
    shown, vehicle = picture.targets["1/2"], picture.vehicles["1"]
    assert (shown.label, shown.seen_unix) == ("person", START + 4.0)
    assert shown.radius95_m == pytest.approx(circle_radius(COV, 0.95), rel=2e-3)
    # The vehicle is four metres north of the origin, 20 m up: target minus relative.
    assert vehicle.lat == pytest.approx(LAT + 4.0 / 111_200.0, abs=1e-7)
    assert vehicle.lon == pytest.approx(LON + 0.0 / cos(radians(LAT)), abs=1e-7)
    assert vehicle.height_m == pytest.approx(20.0)
    reader.tick(START + 100.0)
    assert picture.targets["1/2"].seen_unix == START + 9.0
    assert reader.now() == START + 9.0  # it has ended: its time stands
    reader.close()


DAMAGED = (
    {"type": "target", "time_unix": START + 2.0},
    {
        "type": "target",
        "time_unix": START + 2.0,
        "track": 2,
        "lat": "x",
        "lon": None,
        "cov": [],
        "label": 1,
        "state": 2,
    },
    {"type": "target", "time_unix": 1e30},
    {"type": "clock", "time_monotonic": "soon"},
    {"type": "origin", "time_unix": START + 2.0, "origin": {"lat": 1}},
    {"type": "sighting", "time_unix": START + 2.0, "q_ned_body": [1]},
    {"type": "picture", "time_unix": START + 2.0, "update": {"revision": -1}},
)


def test_damaged_lines_of_a_recording_are_left_out_and_reported(tmp_path):
    path = tmp_path / "t.jsonl"
    lines = Path(targets_file(path)).read_text().splitlines()
    path.write_text("\n".join([*lines[:4], *map(json.dumps, DAMAGED), *lines[4:]]) + "\n")
    picture = GroundPicture()
    reader = ReplayReader(str(path), picture, 1.0)
    reader.tick(START + 1e9)
    assert picture.targets["1/2"].seen_unix == START + 9.0
    (source,) = picture.update_since(0, START).sources
    assert (source.works, source.text.partition("; ")[2]) == (False, "7 damaged lines were left out")
    reader.close()


@pytest.mark.parametrize("between", ["", "x\n" * 20, '{"type": "later"}\n' * 20, "\n" * 20])
def test_a_recording_of_any_density_leaves_each_turn_to_the_page_in_time(tmp_path, monkeypatch, between):
    """20 000 lines were read in one turn: a stranger's recording with long ones, or with any number of lines that are
    left out, stopped the page for minutes.
    """
    cpu_s = [0.0]

    def reading() -> float:
        cpu_s[0] += 0.01
        return cpu_s[0]

    picture, path = GroundPicture(), Path(targets_file(tmp_path / "t.jsonl"))
    *first, last = path.read_text().splitlines()
    path.write_text("\n".join(first) + f"\n{between}{last}\n")
    reader = ReplayReader(str(path), picture, 1.0)
    monkeypatch.setattr(replay_reader.time, "thread_time", reading)
    seen = []
    for _ in range(30):
        reader.tick(START + 100.0)
        seen.append(picture.targets["1/2"].seen_unix - START if picture.targets else None)
    reader.close()
    assert seen[0] != 9.0
    assert seen[-1] == 9.0
    assert seen.index(9.0) >= (11 + between.count("\n")) // 3, "of each turn three lines"


def test_a_pipe_as_a_recording_is_one_line(tmp_path):
    """It was waited for, without a word."""
    os.mkfifo(tmp_path / "t.jsonl")
    with pytest.raises(InputFileError, match="Is a pipe"):
        ReplayReader(str(tmp_path / "t.jsonl"), GroundPicture(), 1.0)


@pytest.mark.parametrize("content", ["", "no json\n", '{"type": "header"}\n', "[1]\n"])
def test_what_is_no_recording_is_one_line(tmp_path, content):
    (tmp_path / "t.jsonl").write_text(content)
    with pytest.raises(InputFileError, match="accepted"):
        ReplayReader(str(tmp_path / "t.jsonl"), GroundPicture(), 1.0)


def test_a_recorded_picture_is_played_back(tmp_path):
    picture = GroundPicture()
    recorder = PictureRecorder(str(tmp_path), picture, START)
    recorder.start()
    for second in range(5):
        view = TargetView(
            id="1/2", vehicle="1", state="confirmed", lat=48.0 + 0.001 * second, lon=11.0, first_unix=START,
            seen_unix=START + second, source="mavlink",
        )  # fmt: skip
        picture.on_target(view, START + second)
        picture.on_vehicle("1", START + second, lat=48.0, lon=11.0, kind="copter")
        recorder.tick(START + second)
    recorder.close()
    played = GroundPicture()
    reader = ReplayReader(str(recorder.path), played, 1.0)
    reader.tick(START + 2.5)
    assert played.targets["1/2"].lat == pytest.approx(48.002)
    assert played.vehicles["1"].kind == "copter"
    reader.close()


def status_file(path, **changes) -> str:
    track = TrackReport(track=7, label="person", state="confirmed", lat=LAT, lon=LON, alt_amsl=519.0,
                        cov=(4.0, 1.0, 0.0, 2.0, 0.0, 1.0), last_seen_s=0.2, first_seen_s=12.0)  # fmt: skip
    fields = {"autopilot": AutopilotReport(system=3), "tracks": [track], "time_monotonic": 5.0}
    path.write_bytes(msgspec.json.encode(RunStatus(**{**fields, **changes})))
    return str(path)


def slow(_status: RunStatus) -> tuple[str, ...]:
    return ("WARNING: slow",)


def read_status(path: str, picture: GroundPicture, wanted, judge=slow) -> None:
    """Read the status until the condition is met."""

    async def read() -> None:
        reader = StatusReader(path, picture, clock=time.time, understand=run_status, judge=judge)
        reader.start()
        async with asyncio.timeout(30.0):
            while not wanted():  # noqa: ASYNC110  # the picture has no event
                await asyncio.sleep(0.01)
        reader.close()

    asyncio.run(read())


def test_the_status_brings_all_tracks_and_what_check_says(tmp_path):
    picture = GroundPicture()
    path = status_file(tmp_path / "status.json")
    read_status(path, picture, lambda: picture.targets)
    shown = picture.targets["3/7"]
    assert (shown.label, shown.source) == ("person", "status")
    assert shown.radius95_m == pytest.approx(circle_radius(COV, 0.95), rel=2e-3)
    assert picture.vehicles["3"].checks == ("WARNING: slow",)
    status_file(tmp_path / "status.json", tracks=[], time_monotonic=6.0)
    read_status(path, picture, lambda: not picture.targets)


@contextmanager
def served(content: bytes) -> Iterator[str]:
    """URL at which a server sends these bytes in two pieces, as a network does."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content[:20])
            time.sleep(0.05)  # two packets, not one
            self.wfile.write(content[20:])

        def log_message(self, *words: object) -> None:
            """Nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/status.json"
        finally:
            server.shutdown()
            thread.join()


CONFIG = """
[[link]]
name = "autopilot"
url = "serial:///dev/nowhere:921600"
role = "autopilot"
[camera]
calibration = "camera.yaml"
"""


def test_a_status_on_another_machine_is_judged_by_a_copy_of_its_configuration(tmp_path):
    """By the status alone: this machine's ports and files say nothing of that one."""
    (tmp_path / "c.toml").write_text(CONFIG)
    status_file(tmp_path / "status.json", internal_faults=2, up_s=60.0)
    picture = GroundPicture()
    with served((tmp_path / "status.json").read_bytes()) as url:
        read_status(url, picture, lambda: picture.targets, _judge(url, str(tmp_path / "c.toml")))
        checks = picture.vehicles["3"].checks
        assert any(line.startswith("WARNING: internal errors of the service: 2") for line in checks)
        assert not any("/dev/nowhere" in line for line in checks), "that port is on the other machine"
        assert any(line.startswith("NOTE: ") and "camera.yaml" in line for line in checks)

        without = GroundPicture()
        read_status(url, without, lambda: without.targets, _judge(url, None))
        assert without.vehicles["3"].checks == (WITHOUT_CONFIG,)


def test_before_an_autopilot_is_heard_the_source_shows_what_check_says(tmp_path):
    picture = GroundPicture()
    path = status_file(tmp_path / "status.json", autopilot=None)
    read_status(path, picture, lambda: picture.update_since(0, 0.0).sources)
    (source,) = picture.update_since(0, 0.0).sources
    assert source.works
    assert source.text == "read, no autopilot yet. WARNING: slow"


@pytest.mark.parametrize("content", [None, b"{", b'{"tracks": 3}'])
def test_a_status_that_cannot_be_read_is_reported(tmp_path, content):
    picture = GroundPicture()
    if content is not None:
        (tmp_path / "status.json").write_bytes(content)
    read_status(str(tmp_path / "status.json"), picture, lambda: picture.update_since(0, 0.0).sources)
    assert not picture.update_since(0, 0.0).sources[0].works


@pytest.mark.parametrize(
    "words", [[], ["--replay", "absent.jsonl"], ["--replay", "t.jsonl", "--speed", "21"], ["--link", "nothing"],
              ["--cot", "nothing", "--link", "udpin://127.0.0.1:1"],
              ["--link", "udpin://127.0.0.1:1", "--http", "8080"], ["--replay", "t.jsonl", "--link", "udpin://h:1"],
              ["--link", "udpin://127.0.0.1:1", "--config", "c.toml"],
              ["--status", "http://127.0.0.1:1/", "--config", "absent.toml"], ["--tiles", "absent", "--link", "udpin://127.0.0.1:14999"]],
)  # fmt: skip
def test_wrong_arguments_are_one_line(tmp_path, words, capsys, monkeypatch):
    from fwav_companion.__main__ import main

    monkeypatch.chdir(tmp_path)
    targets_file(tmp_path / "t.jsonl")
    assert main(["ground", *words]) == 2
    error = capsys.readouterr().err
    assert "accepted" in error
    assert error.count("\n") == 1
    if "nothing" in words:
        assert f"{words[words.index('nothing') - 1]} nothing: " in error


def test_the_program_ends_cleanly(tmp_path):
    from processes import free_port

    words = ["fwav_companion", "ground", "--replay", targets_file(tmp_path / "t.jsonl"), "--http"]
    with process(*words, f"127.0.0.1:{free_port()}", folder=tmp_path) as ground:
        ground.wait_for("ground picture: http")
        assert ground.stop() == 0
