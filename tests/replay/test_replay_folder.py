"""`replay FOLDER`, and replays with a large time offset: a replay has all the time there is."""

import json
import re

import pytest
from commands import run_command
from flying import CAMERA, LINK, fly

from sitl_mock import scenario

CONFIG = LINK + '[camera]\ncalibration = "camera.yaml"\n'


def recorded(folder, flown):
    """Writes the flight's files to a folder; returns the arguments that replay them."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "flight.toml").write_text(CONFIG)
    (folder / "camera.yaml").write_text(CAMERA)
    (folder / "telemetry.tlog").write_bytes(flown.companion.tlog)
    (folder / "detections.jsonl").write_bytes(flown.companion.detections)
    names = {"telemetry": "telemetry.tlog", "detections": "detections.jsonl", "config": "flight.toml"}
    given = (word for option, name in names.items() for word in (f"--{option}", str(folder / name)))
    return ["replay", *given, "--out", str(folder / "targets.jsonl")]


@pytest.fixture(scope="module")
def flown():
    return fly(scenario("unbiased").but({"seconds": 12.0, "seed": 11, "camera.readout_s": 0.0}))


def test_a_folder_replays_as_its_files_do(tmp_path, flown):
    words = recorded(tmp_path / "one", flown)
    assert run_command(*words, folder=tmp_path).returncode == 0
    done = run_command("replay", "one", "--out", "again.jsonl", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    first, again = ((tmp_path / name).read_text().splitlines() for name in ("one/targets.jsonl", "again.jsonl"))
    assert first[1:] == again[1:]


def test_the_folders_camera_file_is_used_wherever_the_flight_had_it(tmp_path, flown):
    recorded(tmp_path / "one", flown)
    (tmp_path / "one/flight.toml").write_text(LINK + '[camera]\ncalibration = "/etc/somewhere/camera.yaml"\n')
    done = run_command("replay", "one", "--out", "again.jsonl", folder=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["my flight", "Flüge, 1. Mai", 'a "b" # c', "back\\slash", "two\nlines", "it's"])
def test_a_folder_of_any_name_is_replayed_with_its_own_camera_file(tmp_path, flown, name):
    recorded(tmp_path / name, flown)
    (tmp_path / name / "flight.toml").write_text(LINK + '[camera]\ncalibration = "/etc/somewhere/camera.yaml"\n')
    done = run_command("replay", name, "--out", "t.jsonl", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    used = json.loads((tmp_path / "t.jsonl").read_text().splitlines()[0])["config"]["camera"]["calibration"]
    assert used == str(tmp_path.resolve() / name / "camera.yaml")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda folder: (folder / "telemetry.tlog").unlink(), "one: it has no telemetry.tlog"),
        (lambda folder: (folder / "flight.toml").unlink(), "it has no configuration"),
        (lambda folder: (folder / "camera.yaml").unlink(), "camera.yaml .*No such file"),
        (
            lambda folder: (folder / "flight.toml").write_text(
                CONFIG + '[ground]\nmodel = "terrain"\nterrain = ["n48.hgt"]\nterrain_datum = "egm96"\n'
            ),
            "n48.hgt",
        ),
    ],
    ids=["telemetry", "configuration", "camera", "terrain"],
)
def test_what_the_folder_lacks_is_one_line_and_exit_2(tmp_path, flown, change, said):
    recorded(tmp_path / "one", flown)
    change(tmp_path / "one")
    done = run_command("replay", "one", "--out", "again.jsonl", folder=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert re.search(said, done.stderr)


def test_two_sources_are_one_too_many(tmp_path, flown):
    words = recorded(tmp_path / "one", flown)
    done = run_command(*words, str(tmp_path / "one"), folder=tmp_path)
    assert done.returncode == 2


@pytest.mark.parametrize("with_arrivals", [True, False], ids=["with arrivals", "without"])
@pytest.mark.parametrize("stamp_clock", ["time_unix", "time_boot"])
def test_a_large_time_offset_refuses_no_frame_as_late(tmp_path, stamp_clock, with_arrivals):
    """The stamps of photographs come 0.9 s late, and the configuration says so."""
    options = scenario("unbiased").but(
        {"seconds": 12.0, "seed": 11, "camera.readout_s": 0.0, "camera.fps": 5.0, "camera.stamp_clock": stamp_clock}
    )
    words = recorded(tmp_path / "one", fly(options))
    on_time, late = (
        _replayed(tmp_path, words, stamp_clock, late_s=late_s, with_arrivals=with_arrivals) for late_s in (0.0, 0.9)
    )
    assert late["dropped"].get("too_late", 0) <= on_time["dropped"].get("too_late", 0)
    assert late["fixes"] >= on_time["fixes"] - 1


def test_stamps_of_a_clock_that_is_ahead_are_no_arrivals_from_the_future(tmp_path):
    """The pictures come in time, with stamps of a clock that is 0.9 s ahead, and the configuration says so."""
    options = scenario("unbiased").but({"seconds": 12.0, "seed": 11, "camera.readout_s": 0.0, "camera.fps": 5.0})
    words = recorded(tmp_path / "one", fly(options.but({"camera.stamp_clock": "time_unix"})))
    even, ahead = (_replayed(tmp_path, words, "time_unix", late_s=late_s, arrives_late=False) for late_s in (0.0, 0.9))
    assert "from_the_future" not in ahead["dropped"]
    assert ahead["fixes"] >= even["fixes"] - 1


def _replayed(folder, words, stamp_clock, *, late_s, with_arrivals=True, arrives_late=True):
    """The summary of the replay of the recording with stamps that are later by so much, as configured."""
    path, lines = folder / "one/detections.jsonl", []
    first = path.read_text()
    for line in first.splitlines():
        frame = json.loads(line)
        if stamp_clock in frame:
            frame[stamp_clock] += late_s
            frame["received_unix"] += late_s if arrives_late else 0.0
            if not with_arrivals:
                del frame["received_unix"]
        lines.append(json.dumps(frame))
    path.write_text("\n".join(lines) + "\n")
    done = run_command(
        *words, "--json", "--set", f"camera.time_offset_s={late_s}", "--set", "camera.readout_s=0", folder=folder
    )
    path.write_text(first)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])
