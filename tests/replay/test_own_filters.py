"""Filters of one's own in `replay`: their code runs only where the user allows it, and never from a recording."""

import subprocess
import sys
from pathlib import Path

import pytest
from flying import CAMERA, LINK, Flight, fly

from fwav_companion.recording.line_decoder import read_lines
from fwav_companion.recording.line_types import TargetLine
from sitl_mock import scenario

CONFIG = LINK + '[camera]\ncalibration = "camera.yaml"\n'

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "mean_filter.py"
OWN = """
class Refuses:
    def __init__(self, priors): raise RuntimeError("no such luck")

class Nothing:
    def __init__(self, priors): pass
"""

ESCAPES = """
from pathlib import Path

Path("escaped").write_text("")
"""


@pytest.fixture(scope="module")
def flown() -> Flight:
    return fly(scenario("unbiased").but({"seconds": 12.0, "seed": 6}))


class Site:
    """A working directory with one's own modules, and a recording in a folder of its own."""

    def __init__(self, folder, flown):
        self.folder, self.flown = folder, flown
        self.recording = folder / "recording"
        self.recording.mkdir()
        self.configure("")
        (self.recording / "camera.yaml").write_text(CAMERA)
        (self.recording / "telemetry.tlog").write_bytes(bytes(flown.companion.tlog))
        (self.recording / "detections.jsonl").write_bytes(bytes(flown.companion.detections))

    def configure(self, more):
        (self.recording / "flight.toml").write_text(CONFIG + more)

    def replay(self, *words, cwd=None):
        files = ["telemetry.tlog", "detections.jsonl", "flight.toml"]
        options = zip(("--telemetry", "--detections", "--config"), files, strict=True)
        given = [each for option, name in options for each in (option, str(self.recording / name))]
        command = [sys.executable, "-m", "fwav_companion", "replay", *given, "--out", "targets.jsonl", *words]
        return subprocess.run(command, capture_output=True, text=True, cwd=cwd or self.folder, timeout=120)


@pytest.fixture
def site(tmp_path, flown):
    return Site(tmp_path, flown)


def test_a_filter_of_ones_own_follows_the_targets(site):
    (site.folder / "mean_filter.py").write_bytes(EXAMPLE.read_bytes())
    done = site.replay("--allow-code", "--set", "tracking.filter=mean_filter:MeanFilter")
    assert done.returncode == 0, done.stderr
    lines = read_lines((site.folder / "targets.jsonl").read_bytes().splitlines()).lines
    assert lines[0].config["tracking"]["filter"] == "mean_filter:MeanFilter"
    confirmed = [line for line in lines if isinstance(line, TargetLine) and line.state == "confirmed"]
    assert site.flown.error_m(confirmed[-1]) < 1.5


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("absent:Means", "No module named 'absent'"),
        ("mine:Absent", "Absent"),
        ("mine:Refuses", "no such luck"),
        ("mine:Nothing", "no method initiate"),
        ("kalmann", '"kalman" | "lowpass"'),
    ],
)
def test_a_filter_that_cannot_be_had_is_one_line_and_exit_2(site, spec, said):
    (site.folder / "mine.py").write_text(OWN)
    done = site.replay("--allow-code", "--set", f"tracking.filter={spec}")
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_recordings_configuration_runs_no_code(site):
    (site.folder / "mine.py").write_text(ESCAPES + OWN)
    site.configure('[tracking]\nfilter = "mine:Means"\n')
    done = site.replay()
    assert done.returncode == 2
    assert "accepted: with --allow-code" in done.stderr
    assert not (site.folder / "escaped").exists()


@pytest.mark.parametrize("inside", [True, False], ids=["run in the recording's folder", "run beside it"])
def test_no_module_is_taken_from_the_recordings_folder(site, inside):
    (site.recording / "mine.py").write_text(ESCAPES + OWN)
    cwd = site.recording if inside else site.folder
    done = site.replay("--allow-code", "--set", "tracking.filter=mine:Means", cwd=cwd)
    assert done.returncode == 2
    assert "No module named 'mine'" in done.stderr
    assert not (cwd / "escaped").exists()


def test_run_takes_no_filter_of_ones_own(site):
    site.configure('[tracking]\nfilter = "mine:Means"\n')
    command = [sys.executable, "-m", "fwav_companion", "run", "--config", "flight.toml"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=site.recording, timeout=60)
    assert done.returncode == 2
    assert "a filter of your own works only in `replay`" in done.stderr
