"""A second flight for the report: a late camera on a crooked mount, and an exact position, so that nothing hides them.

The mock flies it in invented time, as a recording; it is then tracked in three ways. On the first flight GNSS is the
largest error, and there no filter can be told from another.
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
from fwav_companion.recording.lines import Line
from fwav_companion.recording.truth import parse_truth
from fwav_companion.replay import Recording, join, replay
from fwav_companion.replay.telemetry_files import load_telemetry
from fwav_companion.service.configured_files import load_calibration
from fwav_companion.tools.demo.flight import MOCK_MODULE
from fwav_companion.tools.demo.setting import CAMERA_FILE, CONFIG_FILE, PRIORS
from fwav_companion.tools.report import Chapter, Planted, Story, learning, tell, three_ways, way_of
from fwav_companion.tools.report.markup import section
from fwav_companion.tools.report.three_ways import ways_of
from fwav_companion.tools.report.words import length
from fwav_companion.tools.report.writer import other_ways

FOLDER, SCENARIO, SECONDS = "crooked", "late_and_crooked", 60.0
TITLE = "A late camera on a crooked mount"
FLYING_S = 60.0
"""A slow board's invented minute takes this long at most."""
CONFIG = f"""\
# A second flight: stamps 35 ms late, the mount off by (0.5, 1, 2) degrees. This configuration knows neither.

[[link]]
name = "autopilot"
url = "udpin://127.0.0.1:14540"
role = "autopilot"

[camera]
calibration = "{CAMERA_FILE}"
readout_s = 0.0               # a global shutter

[uncertainty]                 # what is left besides: all of it is the camera's
attitude_bias_deg = 0.0
position_noise_m = 0.0
position_bias_m = 0.0
height_noise_m = 0.1
height_bias_m = 0.0
time_offset_sigma_s = 0.05

[tracking]
self_calibration = true
"""


def chapter(out: Path, seed: int, told: Callable[[str], None]) -> Chapter:
    """Where the flight cannot be flown, it says why."""
    told("a second flight, with a late camera on a crooked mount")
    try:
        config = _fly(out / FOLDER, seed)
    except (OSError, subprocess.SubprocessError) as error:
        said = f"This second flight could not be flown: {error}"
        return Chapter([section(TITLE, said, "")], said)
    story = tracked(out / FOLDER, config, told)
    return Chapter([three_ways(story, TITLE, _words(story)), learning(story)], _said(story))


def mock_arguments(config: Config, seed: int) -> list[str]:
    """No bias but the planted ones; noise as the configuration states it."""
    chosen: dict[str, Any] = {f"priors.{name}": getattr(config.uncertainty, name) for name in PRIORS}
    chosen |= {"draw_biases": False, "camera.readout_s": 0.0}
    sets = [f"--set={name}={value!r}" for name, value in chosen.items()]
    return [f"--scenario={SCENARIO}", f"--seed={seed}", f"--seconds={SECONDS}", *sets]


def tracked(folder: Path, config: Config, told: Callable[[str], None]) -> Story:
    """The recording in the folder, in all three ways."""
    recording, calibration = _recording(folder, config), load_calibration(config)

    def again(name: str, chosen: Config) -> Iterator[Line]:
        told(f"the second flight through {name}")
        return replay(recording, chosen, calibration)

    way = way_of(config)
    biases = json.loads((folder / "truth.jsonl").read_text(encoding="utf-8").partition("\n")[0])["biases"]
    return tell(
        list(again(way.name, config)),
        title=FOLDER,
        truth=parse_truth((folder / "truth.csv").read_text(encoding="utf-8"), "truth.csv"),
        way=way,
        others=other_ways(config, again),
        planted=Planted(biases["time_offset_s"], biases["mount_deg"]),
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


def _words(story: Story) -> str:
    planted = story.planted
    if planted is None:
        return ""
    mount = ", ".join(f"{angle:g}°" for angle in planted.mount_deg)
    return (
        f"On the flight above, the error of the GNSS receiver hides what the camera does. So here is another one, "
        f"{SECONDS:.0f} seconds over one target, whose position is exact, but the camera stamps its pictures "
        f"{1e3 * planted.time_offset_s:.0f} ms late and sits crooked by {mount} about the body's axes. Nobody was "
        "told. Solid: how far each answer was from the truth, on a logarithmic scale. Dashed: the distance that it "
        "claimed to stay within in 95 of 100 cases."
    )


def _said(story: Story) -> str:
    """What each way ended with."""
    late_ms = 0.0 if story.planted is None else 1e3 * story.planted.time_offset_s
    ends = [
        f"{way.name} {length(way.last.error_m)}"
        for course in story.courses
        for way in ways_of(course, story)
        if way.last is not None and way.last.error_m is not None
    ]
    flight = f"A second flight, with an exact position but a camera {late_ms:.0f} ms late on a crooked mount"
    return f"{flight}, ended off by: {', '.join(ends)}."
