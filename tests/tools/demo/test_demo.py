"""The command itself: real processes, real UDP, a few seconds."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from frozen import hold, keys

from fwav_companion.tools.demo.processes import locked_folder

COMMAND = [sys.executable, "-m", "fwav_companion", "demo"]


def children_of(pid: int) -> dict[str, int]:
    """Modules that its children run, with their process ids."""
    found = {}
    for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        words = Path(f"/proc/{each}/cmdline").read_bytes().split(b"\0")
        if b"-m" in words:
            found[words[words.index(b"-m") + 1].decode()] = int(each)
    return found


def wait_for(true, timeout_s: float = 30.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.mark.slow
def test_tags_are_found_sent_to_the_ground_and_reported(tmp_path: Path):
    done = subprocess.run(
        [*COMMAND, "--seconds", "7", "--seed", "8", "--out", str(tmp_path / "out"), "--json"],
        capture_output=True, text=True, timeout=90,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads(done.stdout.splitlines()[-1])
    assert result["ok"] is True
    hold("demo", keys([result], "demo"))
    assert result["targets"]
    for target in result["targets"]:
        assert target["found"]
        assert target["error_m"] < 2.0 * target["claimed95_m"]
    assert "received 0 target positions" not in done.stdout
    assert "█" not in done.stdout  # no progress bar in a pipe
    assert "a camera 35 ms late on a crooked mount. Final errors: the paper's filter" in done.stdout
    assert re.search(r"From \d+ m above the ground the median error is [\d.]+ c?m relative to the vehicle", done.stdout)
    html = (tmp_path / "out" / "report.html").read_text()
    assert "variant-calibrated" in html
    assert "data:image/jpeg" in html
    (recording,) = (tmp_path / "out" / "recording").iterdir()
    assert {"telemetry.tlog", "detections.jsonl", "targets.jsonl", "camera.yaml"} <= {
        p.name for p in recording.iterdir()
    }


@pytest.mark.slow
def test_a_camera_that_is_killed_ends_it_with_a_clear_word(tmp_path: Path):
    out = tmp_path / "out"
    command = [*COMMAND, "--seconds", "30", "--out", str(out), "--json"]
    demo = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    pictures = out / "pictures.jsonl"
    wait_for(lambda: pictures.exists() and pictures.stat().st_size > 0)
    others = children_of(demo.pid)
    os.kill(others["sitl_mock.eye"], signal.SIGKILL)
    output, complained = demo.communicate(timeout=30)
    assert demo.returncode == 1
    assert "the mock camera" in complained
    assert "SIGKILL" in complained
    result = json.loads(output.splitlines()[-1])
    assert result["ok"] is False
    assert "SIGKILL" in result["troubles"][0]
    for pid in others.values():
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_a_second_one_in_the_same_folder_is_refused(tmp_path: Path):
    command = [*COMMAND, "--seconds", "3", "--out", str(tmp_path)]
    with locked_folder(tmp_path):
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, list(tmp_path.iterdir())) == (2, [])
    assert f"{tmp_path}: another demonstration uses it" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_recording_that_cannot_be_kept_is_named_at_once(tmp_path: Path):
    """It is not reported as tags that were not seen."""
    (tmp_path / "recording").write_text("no folder")
    done = subprocess.run(
        [*COMMAND, "--seconds", "30", "--out", str(tmp_path)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1
    assert "the service cannot record: recording stopped: " in done.stderr


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--seconds", "1"], "--seconds 1: accepted: 3 to 3600"),
        (["--out", "/proc/nowhere"], "accepted: a folder to write to"),
        (["--seed", "x"], "x: accepted: a whole number from 0"),
        (["--seed", "-1"], "-1: accepted: a whole number from 0"),
    ],
)
def test_a_wrong_use_is_one_line(arguments: list[str], expected: str):
    done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert expected in done.stderr
    assert len(done.stderr.splitlines()) == 1
