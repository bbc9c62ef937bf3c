"""Commands that are stopped during their work: no unfinished file has its final name."""

import signal
import subprocess
import sys

import pytest

from fwav_companion.cli.main import main
from fwav_companion.cli.signals import as_by_ctrl_c
from sitl_mock import scenario
from sitl_mock.recording import record

STOPPED = 130
"""Exit status as after Ctrl-C, for either signal."""

IN_MID_REPLAY = """
from fwav_companion.cli import replay_inputs as given
whole = given.replay

def replay(*words, **options):
    for count, line in enumerate(whole(*words, **options)):
        if count == 100:
            stop()
        yield line

given.replay = replay
"""
IN_MID_PICTURE = """
from matplotlib.figure import Figure

def savefig(_figure, file, **_how):
    with open(file, "wb") if hasattr(file, "parent") else file as opened:
        opened.write(b"half")
        opened.flush()
        stop()

Figure.savefig = savefig
"""
BEFORE_THE_PICTURES = """
from fwav_companion.tools.calibrate import board_spec
board_spec.parse_board = lambda _text: stop()
"""


def stopped(meanwhile, number, *words, cwd, ignored=signal.SIG_DFL):
    """(exit status, stderr) of a command that receives the signal ``meanwhile``."""
    code = f"""
import os, signal, sys

def stop():
    os.kill(os.getpid(), {int(number)})

{meanwhile}
from fwav_companion.cli.main import main
sys.exit(main())
"""

    def heeds() -> None:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        signal.signal(signal.SIGINT, ignored)

    command = [sys.executable, "-c", code, *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=cwd, preexec_fn=heeds)
    return done.returncode, done.stderr


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    assert main(["init", str(folder)]) == 0
    record(scenario("unbiased").but({"seconds": 12.0, "seed": 3}), folder)
    return folder


@pytest.mark.parametrize("before", [None, b"old"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_replay_that_is_stopped_leaves_what_was_there(flight, tmp_path, number, before):
    out = tmp_path / "targets.jsonl"
    if before is not None:
        out.write_bytes(before)
    words = ["--telemetry", "telemetry.tlog", "--detections", "detections.jsonl", "--config", "fwav-companion.toml"]
    status = stopped(IN_MID_REPLAY, number, "replay", *words, "--out", str(out), cwd=flight)
    assert status == (STOPPED, "")
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == (
        {} if before is None else {out.name: before}
    )


def test_an_experiment_that_is_stopped_leaves_no_half_figure(tmp_path):
    assert stopped(IN_MID_PICTURE, signal.SIGTERM, "paper", "--out", "figures", cwd=tmp_path) == (STOPPED, "")
    assert list((tmp_path / "figures").iterdir()) == []


def test_a_calibration_that_is_stopped_ends_as_by_ctrl_c(tmp_path):
    words = ["calibrate", "pictures", "--board", "chessboard:9x6:25mm", "--out", "camera.yaml"]
    assert stopped(BEFORE_THE_PICTURES, signal.SIGTERM, *words, cwd=tmp_path) == (STOPPED, "")


def test_what_a_script_starts_in_the_background_can_be_stopped_too(tmp_path):
    """A shell makes background commands ignore SIGINT; SIGTERM must not be ignored with it."""
    words = ["calibrate", "pictures", "--board", "chessboard:9x6:25mm", "--out", "camera.yaml"]
    status, _ = stopped(BEFORE_THE_PICTURES, signal.SIGTERM, *words, cwd=tmp_path, ignored=signal.SIG_IGN)
    assert status == STOPPED


def test_signals_are_as_before_when_the_work_is_done():
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    with as_by_ctrl_c():
        pass
    assert {number: signal.getsignal(number) for number in before} == before
