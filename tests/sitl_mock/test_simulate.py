"""A whole flight: its order, its repeatability, every scenario, its recording."""

import ast
import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

import sitl_mock
from sitl_mock import SCENARIOS, FrameTruth, VehicleTruth, scenario, simulate
from sitl_mock.codec import Listener
from sitl_mock.recording import record
from sitl_mock.truth import header, target_lines

MOCK = Path(sitl_mock.__file__).parent
COMPANION = MOCK.parent / "fwav_companion"


def events(name="default", **differences):
    return list(simulate(scenario(name).but({"seconds": 3.0, "truth_hz": 10.0, **differences})))


def test_events_come_in_order_of_time():
    instants = [now for now, _ in events("jitter_10ms")]
    assert instants == sorted(instants)
    assert instants[0] >= 1000 * 10**9
    assert instants[-1] <= 1003 * 10**9


def test_the_same_seed_is_the_same_flight_and_another_is_not():
    assert events(seed=5) == events(seed=5)
    assert events(seed=5) != events(seed=6)


def test_another_hash_seed_changes_nothing():
    code = (
        "import sitl_mock, hashlib; s = sitl_mock.simulate(sitl_mock.scenario('corrupted_wire').but({'seconds': 2.0}));"
        "print(hashlib.sha256(repr(list(s)).encode()).hexdigest())"
    )
    digests = {
        subprocess.run(
            [sys.executable, "-c", code], env={"PYTHONHASHSEED": seed}, capture_output=True, check=True, cwd=MOCK.parent
        ).stdout
        for seed in ("1", "2")
    }
    assert len(digests) == 1


def test_the_flight_is_the_same_on_another_clock_base():
    base = [what for _, what in events() if isinstance(what, FrameTruth)]
    moved = [what for _, what in events(start_host_s=5000.0) if isinstance(what, FrameTruth)]
    assert [f.row0_flight_s for f in base] == [f.row0_flight_s for f in moved]


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_scenario_flies(name):
    flight = simulate(scenario(name).but({"seconds": 1.5, "truth_hz": 5.0}))
    kinds = {type(what) for _, what in flight}
    assert kinds == {bytes, dict, FrameTruth, VehicleTruth}
    assert flight.frames > flight.options.camera.fps


@pytest.mark.parametrize("name", ["default", "hover", "nadir", "figure_eight", "racetrack", "walker", "three_targets"])
def test_targets_are_in_view_often_enough_to_be_found(name):
    flight = simulate(scenario(name).but({"seconds": 25.0}))
    visible = [len(what.visible) for _, what in flight if isinstance(what, FrameTruth)]
    assert sum(visible) > 40 * len(flight.scene)


def test_truth_at_an_instant_is_the_flight_s():
    flight = simulate(scenario("default").but({"seconds": 1.0, "truth_hz": 50.0}))
    truths = [what for _, what in flight if isinstance(what, VehicleTruth)]
    assert len(truths) == 51
    for one in truths:
        assert one.position == flight.state_at(one.host_ns).position
        assert one.boot_ns == flight.clock.boot_ns(one.host_ns)


def test_the_boot_clock_drifts_and_inverts():
    clock = simulate(scenario("drifting")).clock
    start = 1000 * 10**9
    assert clock.boot_ns(start + 10**10) - clock.boot_ns(start) == 10**10 + 2 * 10**6
    assert abs(clock.host_ns(clock.boot_ns(start + 123456789)) - start - 123456789) <= 1


def test_a_recording_is_a_tlog_detections_and_truth(tmp_path):
    options = scenario("walker").but({"seconds": 4.0, "truth_hz": 10.0})
    flight = record(options, tmp_path)
    data, at, listener, names = (tmp_path / "telemetry.tlog").read_bytes(), 0, Listener(), []
    stamps = []
    while at < len(data):
        stamps.append(int.from_bytes(data[at : at + 8], "big") * 1e-6)
        length = 12 + data[at + 9]
        names.extend((h.name, h.component) for h in listener.feed(data[at + 8 : at + 8 + length]))
        at += 8 + length
    assert listener.damaged == 0
    assert min(stamps) >= 1_790_000_000
    assert max(stamps) <= 1_790_000_004
    assert names.count(("ATTITUDE_QUATERNION", 1)) > 350
    assert names.count(("TIMESYNC", 191)) >= 39
    frames = [json.loads(line) for line in (tmp_path / "detections.jsonl").read_text().splitlines()]
    assert all(frame["received_unix"] > frame["time_unix"] for frame in frames)
    lines = [json.loads(line) for line in (tmp_path / "truth.jsonl").read_text().splitlines()]
    assert lines[0]["biases"]["mount_deg"] == list(flight.biases.mount_deg)
    assert lines[0]["targets"][0]["label"] == "person"
    assert {line["type"] for line in lines} == {"header", "frame", "vehicle", "summary"}
    with (tmp_path / "truth.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 41
    assert float(rows[10]["time_unix"]) == pytest.approx(1_790_000_001.0)


def test_the_header_s_places_agree_with_each_other():
    flight = simulate(scenario("home_moves"))
    head = header(flight)
    assert head["ekf_origin"]["alt_amsl"] == pytest.approx(521.3)
    assert head["home_before_arming"]["alt_amsl"] == pytest.approx(518.2)
    (line,) = target_lines(flight, 0.0)
    assert (line["north"], line["east"], line["down"]) == (40.0, -25.0, 0.0)
    assert line["alt_amsl"] == 519.0


def imports(package):
    for path in package.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                yield from ((path.name, alias.name) for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                yield path.name, node.module


def test_neither_side_imports_the_other_and_pymavlink_has_one_door():
    mock = list(imports(MOCK))
    assert not [one for one in mock if one[1].startswith("fwav_companion")]
    assert {name for name, module in mock if module.startswith("pymavlink")} == {"codec.py"}
    assert not [one for one in imports(COMPANION) if one[1].startswith("sitl_mock")]


def test_only_the_live_side_touches_clocks_and_sockets():
    shell = {"live.py", "transports.py", "outputs.py", "__main__.py", "eye.py"}
    touching = {name for name, module in imports(MOCK) if module in {"time", "socket", "selectors", "signal", "os"}}
    assert touching <= shell
