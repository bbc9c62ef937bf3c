"""The second flight of the report: a camera with late stamps on a crooked mount, and an exact vehicle position.

The mock flies it in simulated time and records it; three variants of the tracker then replay the recording. On the
first flight the GNSS error is the largest, so that flight cannot separate the variants.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

from fwav_companion.config import Config, load, parse
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.line_types import Line
from fwav_companion.recording.truth import parse_truth
from fwav_companion.replay import Recording, join, replay
from fwav_companion.replay.telemetry_files import load_telemetry
from fwav_companion.service.configured_files import load_calibration
from fwav_companion.tools.demo.flight import MOCK_MODULE
from fwav_companion.tools.demo.flight_setup import CAMERA_FILE, CONFIG_FILE, mock_priors
from fwav_companion.tools.report import (
    CALIBRATED,
    FlightData,
    PlantedErrors,
    SecondFlight,
    SecondResult,
    calibration_section,
    flight_data,
    variant_of,
    variants_section,
)
from fwav_companion.tools.report.page_elements import section
from fwav_companion.tools.report.variants_section import variants_of
from fwav_companion.tools.report.wording import length
from fwav_companion.tools.report.writer import other_variants

FOLDER, SCENARIO, SECONDS = "crooked", "late_and_crooked", 60.0
TITLE = "Second flight: a late camera on a crooked mount"
FLYING_S = 60.0
"""Longest computing time of the simulated minute on a slow board, seconds."""
CONFIG = f"""\
# The second flight: stamps 35 ms late, mount off by (0.5, 1, 2) degrees. This configuration knows neither.

[[link]]
name = "autopilot"
url = "udpin://127.0.0.1:14540"
role = "autopilot"

[camera]
calibration = "{CAMERA_FILE}"
readout_s = 0.0               # a global shutter

[uncertainty]                 # only the camera has errors
attitude_bias_deg = 0.0
position_noise_m = 0.0
position_bias_m = 0.0
height_noise_m = 0.1
height_bias_m = 0.0
time_offset_sigma_s = 0.05

[tracking]
self_calibration = true
"""


def second_flight(out: Path, seed: int, progress: Callable[[str], None]) -> SecondFlight:
    """Fly and evaluate the second flight; where it cannot be flown, its section says why."""
    progress("a second flight, with a late camera on a crooked mount")
    try:
        config = _fly(out / FOLDER, seed)
    except (OSError, subprocess.SubprocessError) as error:
        words = f"This second flight could not be flown: {error}"
        return SecondFlight([section(TITLE, words, "")], SecondResult(words))
    flight = tracked(out / FOLDER, config, progress)
    return SecondFlight([variants_section(flight, TITLE, _words(flight)), calibration_section(flight)], _result(flight))


def mock_arguments(config: Config, seed: int) -> list[str]:
    """Arguments of the mock: no error but the planted ones; noise as the configuration states it."""
    chosen: dict[str, Any] = mock_priors(config)
    chosen |= {"draw_biases": False, "camera.readout_s": 0.0}
    sets = [f"--set={name}={value!r}" for name, value in chosen.items()]
    return [f"--scenario={SCENARIO}", f"--seed={seed}", f"--seconds={SECONDS}", *sets]


def tracked(folder: Path, config: Config, progress: Callable[[str], None]) -> FlightData:
    """The recording in the folder, tracked in all three variants."""
    recording, calibration = _recording(folder, config), load_calibration(config)

    def replayed(name: str, chosen: Config) -> Iterator[Line]:
        progress(f"the second flight with {name}")
        return replay(recording, chosen, calibration)

    variant = variant_of(config)
    biases = json.loads((folder / "truth.jsonl").read_text(encoding="utf-8").partition("\n")[0])["biases"]
    return flight_data(
        list(replayed(variant.name, config)),
        title=FOLDER,
        truth=parse_truth((folder / "truth.csv").read_text(encoding="utf-8"), "truth.csv"),
        variant=variant,
        others=other_variants(config, replayed),
        planted=PlantedErrors(biases["time_offset_s"], biases["mount_deg"]),
    )


def _fly(folder: Path, seed: int) -> Config:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / CONFIG_FILE).write_text(CONFIG, encoding="utf-8")
    camera = files("fwav_companion.cli.templates") / CAMERA_FILE
    (folder / CAMERA_FILE).write_text(camera.read_text(encoding="utf-8"), encoding="utf-8")
    arguments = mock_arguments(parse(CONFIG, CONFIG_FILE), seed)
    command = [sys.executable, "-m", MOCK_MODULE, *arguments, "--record", str(folder)]
    subprocess.run(command, capture_output=True, timeout=FLYING_S, check=True)  # noqa: S603  # our own module
    return load(folder / CONFIG_FILE)


def _recording(folder: Path, config: Config) -> Recording:
    own = own_components(config)
    telemetry = load_telemetry(folder / "telemetry.tlog", own)
    return join(telemetry, (folder / "detections.jsonl").read_bytes(), own, config.vehicle.system_id)


def _words(flight: FlightData) -> str:
    planted = flight.planted
    if planted is None:
        return ""
    mount = ", ".join(f"{angle:g}°" for angle in planted.mount_deg)
    return (
        f"On the first flight the error of the GNSS receiver hides the errors of the camera. On this flight, "
        f"{SECONDS:.0f} seconds over one target, the vehicle's position is exact, but the camera stamps its pictures "
        f"{1e3 * planted.time_offset_s:.0f} ms late and its mount is turned by {mount} about the body axes. The "
        "service does not know these values. Solid: distance of each estimate from the truth, on a logarithmic scale. "
        "Dashed: claimed radius, which 95 % of the errors should not exceed."
    )


def _result(flight: FlightData) -> SecondResult:
    """The final error of each variant, and the card of the best one."""
    late_ms = 0.0 if flight.planted is None else 1e3 * flight.planted.time_offset_s
    ends = [
        (variant.name, variant.last.error_m)
        for target in flight.targets
        for variant in variants_of(target, flight)
        if variant.last is not None and variant.last.error_m is not None
    ]
    setting = f"A second flight has an exact position, but a camera {late_ms:.0f} ms late on a crooked mount"
    errors = ", ".join(f"{name} {length(error_m)}" for name, error_m in ends)
    final_m = dict(ends).get(CALIBRATED.name)
    card = None if final_m is None else (length(final_m), "second flight: error after self-calibration")
    return SecondResult(f"{setting}. Final errors: {errors}.", card)
