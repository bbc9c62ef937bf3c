"""Ten targets and one at thirty frames a second with self-calibration on: what the pipeline takes of one core.

A recorded flight of a camera with a delay and a mount error is replayed by a process of its own, as ``replay`` runs it,
with start, reading and writing included. Attitudes come at 100 Hz, every target is in nearly every picture, and targets
are three metres apart. ``python -m tests.benchmarks.ten_targets``
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import msgspec

from sitl_mock import TargetOptions, scenario
from sitl_mock.recording import record
from tests.benchmarks.figure import Figure
from tests.benchmarks.startup import relay_configuration

SECONDS = 120.0
ROUNDS = 3
BUDGET_PERCENT, BUDGET_SPEED = 7.0, 50.0
TARGETS = tuple(TargetOptions(north=3.0 * (k % 4) - 4.5, east=3.0 * (k // 4) - 3.0) for k in range(10))
FLIGHT = {
    "seconds": SECONDS,
    "biases.time_offset_s": 0.035,
    "biases.mount_deg": (0.5, 1.0, 2.0),
}
CONFIGURATION = """
[camera]
calibration = "made/camera.yaml"
[tracking]
self_calibration = {calibrates}
"""


def _replayed(folder: Path, *, calibrates: bool) -> tuple[float, str]:
    """(CPU seconds of a replay, final status of self-calibration)."""
    (folder / "flight.toml").write_text(
        relay_configuration(24598) + CONFIGURATION.format(calibrates=str(calibrates).lower())
    )
    files = ["--telemetry", "telemetry.tlog", "--detections", "detections.jsonl", "--out", "targets.jsonl"]
    command = [sys.executable, "-m", "fwav_companion", "replay", "--config", "flight.toml", *files]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"replay ended with {process.returncode}")
    lines = map(msgspec.json.decode, (folder / "targets.jsonl").read_bytes().splitlines())
    reported = [line["status"] for line in lines if line["type"] == "calibration"]
    return used.ru_utime + used.ru_stime, reported[-1] if reported else "off"


def _spent(flight: dict[str, object]) -> tuple[float, str]:
    """(CPU seconds with self-calibration, detail), with and without it in alternation."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(
            [sys.executable, "-m", "fwav_companion", "init", "made"], cwd=folder, check=True, capture_output=True
        )
        record(scenario("default").but(FLIGHT | flight), folder)
        rounds = [[_replayed(folder, calibrates=on) for on in (True, False)] for _ in range(ROUNDS)]
    (on_s, off_s), came_to = (median(s for s, _ in spent) for spent in zip(*rounds, strict=True)), rounds[0][0][1]
    without = f"{off_s / SECONDS:.1%}, {SECONDS / off_s:.0f}x without self-calibration, which came to {came_to!r}"
    return on_s, f"{on_s / SECONDS:.1%}, {SECONDS / on_s:.0f}x real time; {without}"


def measure() -> list[Figure]:
    """The share of ten targets, and the speed of one."""
    (ten_s, ten), (one_s, one) = _spent({"targets": TARGETS}), _spent({})
    share, speed = 100.0 * ten_s / SECONDS, SECONDS / one_s
    return [
        Figure("ten targets with self-calibration, % of a core", share, BUDGET_PERCENT, False, ten),
        Figure("replay of one target with self-calibration, x real time", speed, BUDGET_SPEED, True, one),
    ]


if __name__ == "__main__":
    print(*measure(), sep="\n")
