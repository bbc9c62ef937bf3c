"""report.html of a demonstration: its recording, the mock's truth, a picture rendered again, a second flight."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fwav_companion.config import Config, load
from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import whole
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.lines import Line
from fwav_companion.recording.truth import parse_truth
from fwav_companion.replay import join, replay
from fwav_companion.replay.telemetry_files import load_telemetry
from fwav_companion.service.configured_files import load_calibration
from fwav_companion.tools.demo.crooked import chapter
from fwav_companion.tools.demo.flight import EYE_MODULE
from fwav_companion.tools.demo.gnss_error import mean_position_error_m
from fwav_companion.tools.demo.setting import CONFIG_FILE, SCENARIO, Setting
from fwav_companion.tools.report import PictureShown, page, tell
from fwav_companion.tools.report.depths import depths

PICTURE = "picture.jpg"
RENDERING_S = 60.0
NOTE = (
    "The autopilot was a mock in a process of its own, its camera's pictures were rendered, and all that is above came "
    "through the same service that flies."
)


def write_report(
    setting: Setting, flight_arguments: Sequence[str], out: Path, recording: Path, told: Callable[[str], None]
) -> tuple[Path, str]:
    """The file's path, and what the second flight showed. ``told`` is called with what is being done."""
    told("the flight, replayed")
    lines = _replayed(recording, load(recording / CONFIG_FILE))
    truth = [json.loads(line) for line in (out / "truth.jsonl").read_text(encoding="utf-8").splitlines()]
    story = tell(
        lines,
        title="Tags found from a flapping wing",
        truth=parse_truth((out / "truth.csv").read_text(encoding="utf-8"), "truth.csv"),
        true_path=[(line["position"][0], line["position"][1]) for line in truth if line["type"] == "vehicle"],
        picture=_picture(flight_arguments, out, recording),
        hidden=_hidden(truth[0]["biases"], mean_position_error_m(lines, truth)) if truth else {},
        notes=[
            f"A demonstration with seed {setting.seed}: nothing was attached. {NOTE}",
            f"Again: {_command(setting)}",
        ],
    )
    path = out / "report.html"
    crooked = chapter(out, setting.seed, told)
    try:
        with whole(path) as file:
            file.write(page(story, depths(lines), crooked).encode())
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; accepted: a folder to write to") from None
    return path, crooked.said


def _command(setting: Setting) -> str:
    words = f"fwav-companion demo --seed {setting.seed} --seconds {setting.seconds:g}"
    return words if setting.scenario == SCENARIO else f"{words} --scenario {setting.scenario}"


def _replayed(recording: Path, config: Config) -> list[Line]:
    own = own_components(config)
    telemetry = load_telemetry(recording / "telemetry.tlog", own)
    joined = join(telemetry, (recording / "detections.jsonl").read_bytes(), own, config.vehicle.system_id)
    return list(replay(joined, config, load_calibration(config), sightings=True))


def _picture(flight_arguments: Sequence[str], out: Path, recording: Path) -> PictureShown | None:
    """The frame in which most was seen, rendered again: the same seed gives the same picture."""
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
    return PictureShown((out / PICTURE).read_bytes(), size, best["frame"], best["detections"])


def _interest(frame: Mapping[str, Any]) -> tuple[int, float]:
    """Many tags, then large ones."""
    boxes = [found["box"] for found in frame["detections"] if found.get("box")]
    return len(frame["detections"]), min(((box[2] - box[0]) for box in boxes), default=0.0)


def _hidden(biases: Mapping[str, Any], position_m: tuple[float, float] | None) -> dict[str, str]:
    position = f"{biases['position_sigma_m']:.1f} m, one sigma"
    if position_m is not None:
        position = f"{position_m[0]:+.2f}, {position_m[1]:+.2f} m"
    mount = ", ".join(f"{angle:+.2f}" for angle in biases["mount_deg"])
    return {
        "camera's stamps come late by": f"{biases['time_offset_s'] * 1e3:+.1f} ms",
        "camera mounted off by (x, y, z)": f"{mount} °",
        "compass off by": f"{biases['heading_deg']:+.2f} °",
        "roll and pitch off by": f"{biases['attitude_roll_deg']:+.2f}, {biases['attitude_pitch_deg']:+.2f} °",
        "height off by": f"{biases['height_m']:+.2f} m",
        "position off on the mean (north, east)": position,
    }
