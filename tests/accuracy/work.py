"""Flies and scores one flight; counts the instructions of one with callgrind.

``python -m tests.accuracy.work KIND ESTIMATOR FOLDER SECONDS``: what callgrind runs. With 0 s it only loads and reads.
"""

from __future__ import annotations

import gc
import os
import re
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

from sitl_mock import Simulation
from tests.accuracy.flights import plan_of, recording_of, replayed
from tests.accuracy.scores import FlightScore, Tracks, TruthOf, flight_score

COUNTED = ("eight_late_and_crooked", "orbit_1", "targets_10", "photographs")
COUNTED_S = 20.0


def scored(kind: str, seed: int, estimator: str, folder: Path, random_seed: int = 1) -> FlightScore:
    """The score of one flight. Its CPU seconds are those of the replay, without reading the recording."""
    plan = plan_of(kind, seed, random_seed)
    recording = recording_of(plan, folder)
    simulation = Simulation(plan.options)
    truth = TruthOf(simulation, plan.landmarks)
    lines = replayed(plan, recording, estimator)
    gc.collect()
    begun_s = time.process_time()
    kept = [line for line in lines if line["type"] in ("target", "calibration")]
    cpu_s = time.process_time() - begun_s
    tracks = Tracks(truth)
    for line in kept:
        tracks.add(line)
    targets = len(set(recording.in_view).intersection(truth.targets))
    return flight_score(tracks, simulation, targets, recording.first_seen_s, seed=seed, cpu_s=cpu_s)


def instructions_m(kind: str, estimator: str, folder: Path) -> float:
    """Million instructions a flight second: the first 20 s replayed, less a run that only reads them."""
    whole, only_read = (_counted(kind, estimator, folder, seconds) for seconds in (COUNTED_S, 0.0))
    return (whole - only_read) / COUNTED_S / 1e6


def _counted(kind: str, estimator: str, folder: Path, seconds: float) -> int:
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", sys.executable, "-m",
               "tests.accuracy.work", kind, estimator, str(folder), str(seconds)]  # fmt: skip
    done = subprocess.run(
        command, env={**os.environ, "PYTHONHASHSEED": "0"}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    match = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode or match is None:
        raise RuntimeError(f"callgrind: {done.stderr[-500:]}")
    return int(match[1])


def main(kind: str, estimator: str, folder: str, seconds: float) -> None:
    """Replays the first part of a kind's first flight."""
    plan = plan_of(kind, 1)
    short = replace(plan, name=f"{plan.name}-short", options=plan.options.but({"seconds": COUNTED_S}))
    for line in replayed(short, recording_of(short, Path(folder)), estimator):
        if not seconds:
            break
        del line


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4]))
