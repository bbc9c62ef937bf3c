"""One flight of a kind: its recording, kept in a folder, and its replay by a named estimator.

The same kind and seed give the same bytes, whatever estimator replays them. A recording's folder is named by a digest
of the flight's options and of the mock's own source, so that none outlives a change.

``python -m tests.accuracy.flights KIND ESTIMATOR FOLDER SECONDS`` is what callgrind counts; with 0 s it only reads.
"""

from __future__ import annotations

import gc
import hashlib
import json
import os
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from io import BytesIO, StringIO
from pathlib import Path
from random import Random
from tempfile import mkdtemp

import sitl_mock
from fwav_companion.camera import Calibration, parse_calibration
from fwav_companion.config import parse
from fwav_companion.localization import ElevationTile
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.line_types import CalibrationLine, Line, TargetLine
from fwav_companion.replay import read_recording, replay
from fwav_companion.tools.study.flight_draw import draw_flight
from sitl_mock import Options, Simulation
from sitl_mock.arguments import with_settings
from sitl_mock.camera import FrameTruth
from sitl_mock.outputs import DetectionLines
from sitl_mock.recording import Recorded
from sitl_mock.scenarios import scenario
from sitl_mock.simulate import Event
from tests.accuracy.kinds import KINDS, RANDOM, SURVEY_SIGMA_M, Kind, stated
from tests.accuracy.scores import FlightScore, Tracks
from tests.studies.drawn_configurations import drawn_plan
from tests.support.configured_links import AUTOPILOT
from tests.support.surface_tiles import surface_tile

ESTIMATORS: dict[str, tuple[str, ...]] = {
    "second": ("tracking.self_calibration=true",),
    "third": ("tracking.self_calibration=true",),
    "plain": ("tracking.self_calibration=false",),
}
"""Settings of the replay that choose an estimator, by its name."""
SMOOTHS = frozenset({"third"})
"""Estimators that are the smoother."""
CAMERA = """
model: kannala_brandt
image_size: [640, 480]
k_mm: [3.55, 0.03, 0.0, 0.0, 0.0]
pixels_per_mm: [188.0, 188.0]
principal_point: [320.0, 240.0]
"""
CONFIGURATION = f'{AUTOPILOT}[camera]\ncalibration = "camera.yaml"\n'
SEEN = "seen.json"
COUNTED = ("eight_late_and_crooked", "orbit_1", "targets_10", "photographs")
COUNTED_S = 20.0
"""Kinds and time whose instructions are counted."""
FEW_PICTURES = 4
"""Fewest pictures with a target in view that count it as one to be found."""


@dataclass(frozen=True)
class Plan:
    """One flight before it is flown, and the configuration of its replay."""

    name: str
    """Kind and seed."""
    options: Options
    text: str
    """Configuration, TOML."""
    settings: tuple[str, ...]
    calibration: Calibration
    rates_hz: dict[str, float] | None = None
    """Message rates that the recording companion requests; None: the mock's own."""
    has_surface: bool = False
    landmarks: frozenset[str] = frozenset()
    """Labels of landmarks: their errors are not scored."""


@dataclass(frozen=True)
class Recording:
    """The files of a flown flight."""

    telemetry: bytes
    detections: bytes
    first_seen_s: float | None
    """Flight time of the first picture with a target in view."""
    in_view: tuple[int, ...]
    """Indices of the targets that were in view of FEW_PICTURES."""


def seeds_of(count: int, date: str = "") -> list[int]:
    """Seeds of the flights: 1 and up, or drawn from a date."""
    if not date:
        return list(range(1, count + 1))
    return [int.from_bytes(hashlib.sha256(f"{date}/{k}".encode()).digest()[:4], "big") for k in range(count)]


def plan_of(name: str, seed: int, random_seed: int = 1) -> Plan:
    """The flight of a kind with this seed. Of the random configurations the seed is the index of one of a study."""
    if name == RANDOM:
        study = drawn_plan(random_seed, seed)
        draw = draw_flight(study, seed)
        options = with_settings(scenario("default"), draw.request["set"])
        title = f"{name}-{random_seed}-{seed}"
        return Plan(title, options, study.config, draw.settings, Calibration(study.lens.lens), draw.request["rates_hz"])
    kind = KINDS[name]
    options = kind.options(seed)
    return Plan(
        f"{name}-{seed}", options, CONFIGURATION + _landmarks(kind, options), (*stated(options), *kind.settings),
        parse_calibration(CAMERA, "camera.yaml"), None, kind.has_surface, frozenset(kind.marks),
    )  # fmt: skip


def _landmarks(kind: Kind, options: Options) -> str:
    mock, text = Simulation(options), ""
    for target in mock.scene[: len(kind.marks)]:
        rng, wrong = Random(f"{options.seed}/survey/{target.label}"), (*kind.marks[target.label], 0.0)
        surveyed = [x + rng.gauss(0.0, SURVEY_SIGMA_M) + off for x, off in zip(target.at(0.0), wrong, strict=True)]
        place = mock.world.place((surveyed[0], surveyed[1], surveyed[2]))
        text += f'[[landmark]]\nlabel = "{target.label}"\nlat = {place.lat:.9f}\nlon = {place.lon:.9f}\n'
        text += f"alt_amsl = {place.alt_amsl:.4f}\nsigma_m = {SURVEY_SIGMA_M}\n"
    return text


def recording_of(plan: Plan, folder: Path) -> Recording:
    """The flight's recording, flown unless the folder has it."""
    key = hashlib.sha256(f"{_mock_digest()}{plan.options!r}{plan.rates_hz!r}".encode()).hexdigest()[:16]
    kept = folder / f"{plan.name}-{key}"
    if not kept.exists():
        flown = fly(plan)
        folder.mkdir(parents=True, exist_ok=True)
        part = Path(mkdtemp(dir=folder))
        (part / "telemetry.tlog").write_bytes(flown.telemetry)
        (part / "detections.jsonl").write_bytes(flown.detections)
        (part / SEEN).write_text(json.dumps([flown.first_seen_s, flown.in_view]))
        try:
            part.rename(kept)
        except OSError:  # another process was earlier, with the same bytes
            if not kept.exists():
                raise
    telemetry, detections = (kept / "telemetry.tlog").read_bytes(), (kept / "detections.jsonl").read_bytes()
    first_seen_s, in_view = json.loads((kept / SEEN).read_text())
    return Recording(telemetry, detections, first_seen_s, tuple(in_view))


@cache
def _mock_digest() -> str:
    sources = sorted(Path(sitl_mock.__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()


def fly(plan: Plan) -> Recording:
    """The mock's recording of the flight."""
    tlog, detections = BytesIO(), StringIO()
    first_seen_s: list[float] = []
    pictures: Counter[int] = Counter()

    def note_sights(event: Event) -> None:
        if isinstance(event[1], FrameTruth) and event[1].visible:
            first_seen_s.append(event[1].row0_flight_s)
            pictures.update(event[1].visible)

    simulation = Recorded(plan.options, tlog)
    simulation.fly(DetectionLines(detections, simulation.unix_minus_host_s), note_sights, plan.rates_hz)
    in_view = tuple(sorted(index for index, count in pictures.items() if count >= FEW_PICTURES))
    return Recording(tlog.getvalue(), detections.getvalue().encode(), min(first_seen_s, default=None), in_view)


def replayed(plan: Plan, recording: Recording, estimator: str) -> Iterator[Line]:
    """The lines of the replay by an estimator. The recording is read before the first line is asked for."""
    config = parse(plan.text, "flight.toml", (*plan.settings, *ESTIMATORS[estimator]))
    read = read_recording(recording.telemetry, recording.detections, own_components(config), config.vehicle.system_id)
    elevation: Sequence[ElevationTile] = (surface_tile(Simulation(plan.options)),) if plan.has_surface else ()
    return replay(read, config, plan.calibration, elevation=elevation, smooths=estimator in SMOOTHS)


def scored(kind: str, seed: int, estimator: str, folder: Path, random_seed: int = 1) -> FlightScore:
    """The score of one flight. Its CPU seconds are those of the replay, without reading the recording."""
    plan = plan_of(kind, seed, random_seed)
    recording = recording_of(plan, folder)
    lines = replayed(plan, recording, estimator)
    gc.collect()
    begun_s = time.process_time()
    kept = [line for line in lines if isinstance(line, TargetLine | CalibrationLine)]
    cpu_s = time.process_time() - begun_s
    tracks = Tracks(Simulation(plan.options), plan.landmarks)
    for line in kept:
        tracks.add(line)
    return tracks.score(recording.in_view, recording.first_seen_s, cpu_s=cpu_s, seed=seed)


def instructions_m(kind: str, estimator: str, folder: Path) -> float:
    """Million instructions a flight second: the first 20 s of a kind's first flight replayed, less a run that only
    reads them.
    """
    recording_of(_first_part(kind), folder)  # else the first run would fly it, and the flying would count
    whole, only_read = (_counted(kind, estimator, folder, seconds) for seconds in (COUNTED_S, 0.0))
    return (whole - only_read) / COUNTED_S / 1e6


def _counted(kind: str, estimator: str, folder: Path, seconds: float) -> int:
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", sys.executable, "-m",
               "tests.accuracy.flights", kind, estimator, str(folder), str(seconds)]  # fmt: skip
    done = subprocess.run(
        command, env={**os.environ, "PYTHONHASHSEED": "0"}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    match = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode or match is None:
        raise RuntimeError(f"callgrind: {done.stderr[-500:]}")
    return int(match[1])


def _first_part(kind: str) -> Plan:
    plan = plan_of(kind, 1)
    return replace(plan, name=f"{plan.name}-short", options=plan.options.but({"seconds": COUNTED_S}))


def replay_first_part(kind: str, estimator: str, folder: str, seconds: float) -> None:
    """Replays the first part of a kind's first flight; with 0 s only its first line."""
    plan = _first_part(kind)
    for _ in replayed(plan, recording_of(plan, Path(folder)), estimator):
        if not seconds:
            break


if __name__ == "__main__":
    replay_first_part(sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4]))
