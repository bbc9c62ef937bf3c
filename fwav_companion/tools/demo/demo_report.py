"""The report of a demonstration: its recording, the mock's truth, one picture rendered again, and a second flight."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from math import hypot
from pathlib import Path
from statistics import median
from typing import Any

import msgspec

from fwav_companion.config import Config, load
from fwav_companion.errors import InputFileError
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.on_disk import whole
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.line_types import Line, OriginObject, header_of
from fwav_companion.recording.truth import parse_truth
from fwav_companion.replay import join, replay
from fwav_companion.replay.telemetry_files import load_telemetry
from fwav_companion.service.configured_files import load_calibration
from fwav_companion.tools.demo.calibration_flight import second_flight
from fwav_companion.tools.demo.flight import EYE_MODULE
from fwav_companion.tools.demo.flight_setup import CONFIG_FILE, SCENARIO, FlightSetup
from fwav_companion.tools.report import CameraPicture, FlightData, TrueVehiclePath, diagnostics, flight_data, page
from fwav_companion.tools.report.wording import length

PICTURE = "picture.jpg"
RENDERING_S = 60.0
"""Longest time for rendering the picture again, seconds."""
NOTE = (
    "The autopilot was a mock in a process of its own and the camera's pictures were rendered. Everything else came "
    "from the same service that flies on a vehicle."
)


def write_report(
    setup: FlightSetup,
    flight_arguments: Sequence[str],
    *,
    out: Path,
    recording: Path,
    progress: Callable[[str], None],
) -> tuple[Path, list[str]]:
    """The report's path, and its results as sentences. ``progress`` is called with the name of each step."""
    progress("the flight, replayed")
    lines = _replayed(recording, load(recording / CONFIG_FILE))
    header = header_of(lines)
    truth = [json.loads(line) for line in (out / "truth.jsonl").read_text(encoding="utf-8").splitlines()]
    flight = flight_data(
        lines,
        title="Tags found from a flapping wing",
        truth=parse_truth((out / "truth.csv").read_text(encoding="utf-8"), "truth.csv"),
        true_path=true_path(truth, None if header is None else header.origin),
        picture=_picture(flight_arguments, out, recording),
        notes=[
            f"A demonstration with seed {setup.seed}: nothing was attached. {NOTE}",
            f"Repeat it: {_command(setup)}",
        ],
    )
    if truth:
        flight = msgspec.structs.replace(flight, hidden=_hidden(truth[0]["biases"], flight.position_error_m))
    path = out / "report.html"
    second = second_flight(out, setup.seed, progress)
    try:
        with whole(path) as file:
            file.write(page(flight, diagnostics(lines), second).encode())
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; accepted: a folder to write to") from None
    return path, [*_result(flight), second.result.sentence]


def _command(setup: FlightSetup) -> str:
    words = f"fwav-companion demo --seed {setup.seed} --seconds {setup.seconds:g}"
    return words if setup.scenario == SCENARIO else f"{words} --scenario {setup.scenario}"


def _result(flight: FlightData) -> list[str]:
    """The errors relative to the vehicle and on the map in one sentence; empty where they are not known."""
    errors = [
        (target.relative_error_m, target.last.error_m)
        for target in flight.targets
        if target.found and target.last is not None and target.last.error_m is not None
        if target.relative_error_m is not None
    ]
    if not errors or flight.position_error_m is None or flight.height_m is None:
        return []
    relative, on_the_map = (length(median(column)) for column in zip(*errors, strict=True))
    sentence = (
        f"From {flight.height_m:.0f} m above the ground the median error is {relative} relative to the vehicle, and "
        f"{on_the_map} on the map, where the GNSS error of {length(hypot(*flight.position_error_m))} moves all tags "
        "together."
    )
    return [sentence]


def true_path(truth: Sequence[Mapping[str, Any]], origin: OriginObject | None) -> TrueVehiclePath:
    """The mock's positions about the recording's origin: a service that starts late takes another than the mock's."""
    vehicle = [line for line in truth if line["type"] == "vehicle"]
    positions: list[Vector3] = [tuple(line["position"]) for line in vehicle]
    if vehicle and origin is not None:
        mock, ours = msgspec.convert(truth[0]["origin"], OriginObject).plane, origin.plane
        positions = [ours.ned_from_geodetic(mock.geodetic_from_ned(position)) for position in positions]
    return TrueVehiclePath(times_boot_s=[line["boot_ns"] * 1e-9 for line in vehicle], positions_ned=positions)


def _replayed(recording: Path, config: Config) -> list[Line]:
    own = own_components(config)
    telemetry = load_telemetry(recording / "telemetry.tlog", own)
    joined = join(telemetry, (recording / "detections.jsonl").read_bytes(), own, config.vehicle.system_id)
    return list(replay(joined, config, load_calibration(config), sightings=True))


def _picture(flight_arguments: Sequence[str], out: Path, recording: Path) -> CameraPicture | None:
    """The frame with the most detections, rendered again: the same seed gives the same picture."""
    frames = [json.loads(line) for line in (recording / "detections.jsonl").read_bytes().splitlines()]
    frames = [frame for frame in frames if frame.get("detections")]
    if not frames:
        return None
    best = max(frames, key=_interest)
    rendering = ["--frame", str(best["frame"]), "--picture", str(out / PICTURE)]
    command = [sys.executable, "-m", EYE_MODULE, *flight_arguments, *rendering]
    done = subprocess.run(command, capture_output=True, timeout=RENDERING_S, check=False)  # noqa: S603  # our own module
    if done.returncode != 0:
        return None
    size = (best["size"][0], best["size"][1])
    return CameraPicture((out / PICTURE).read_bytes(), size, best["frame"], best["detections"])


def _interest(frame: Mapping[str, Any]) -> tuple[int, float]:
    """Sort key of a frame: number of tags, then the width of the smallest one."""
    boxes = [found["box"] for found in frame["detections"] if found.get("box")]
    return len(frame["detections"]), min(((box[2] - box[0]) for box in boxes), default=0.0)


def _hidden(biases: Mapping[str, Any], position_m: tuple[float, float] | None) -> dict[str, str]:
    """True errors of the vehicle, by name."""
    mount = ", ".join(f"{angle:+.2f}" for angle in biases["mount_deg"])
    errors = {
        "delay of the camera's stamps": f"{biases['time_offset_s'] * 1e3:+.1f} ms",
        "rotation of the mount (x, y, z)": f"{mount} °",
        "compass": f"{biases['heading_deg']:+.2f} °",
        "roll and pitch": f"{biases['attitude_roll_deg']:+.2f}, {biases['attitude_pitch_deg']:+.2f} °",
        "height": f"{biases['height_m']:+.2f} m",
    }
    if position_m is not None:
        errors["mean GNSS position (north, east)"] = f"{position_m[0]:+.2f}, {position_m[1]:+.2f} m"
    return errors
