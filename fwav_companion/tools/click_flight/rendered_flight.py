"""SHELL: the mock's flight for a click: its recording, its rendered pictures, and the true places of a spot in them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import IO, Final

import msgspec
import numpy as np

from fwav_companion.config import Config, load, parse
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.replay import Recording, join
from fwav_companion.replay.telemetry_files import load_telemetry
from fwav_companion.tools.demo.flight_setup import CAMERA_FILE, CONFIG_FILE, FlightSetup
from fwav_companion.vision.images import Pixels

MOCK, EYE, SPOT = "sitl_mock", "sitl_mock.eye", "sitl_mock.spot"
FLIGHT: Final = ("camera.fps=15.0", "flight.half_axes_m=(5.0,3.0)", "flight.speed_m_s=2.5")
"""A small figure of eight: the spot leaves the picture and returns several times in half a minute."""
RECORDING_S: Final = 120.0
"""Longest computing time of the flight's telemetry on a slow board, seconds."""


class SpotSight(msgspec.Struct, frozen=True):
    """One frame that shows the true spot."""

    frame: int
    at_s: float
    """Time of the flight, seconds."""
    pixel: tuple[float, float]
    blur_px: float
    """Motion of the spot during the exposure, pixels."""
    metres_per_px: float


class TrueSpot(msgspec.Struct, frozen=True):
    """The spot that was clicked, by the mock's own geometry."""

    lat: float
    lon: float
    sights: tuple[SpotSight, ...]


class RenderedFlight:
    """One flight of the mock in a folder."""

    def __init__(self, folder: Path, seed: int, seconds: float) -> None:
        setup = FlightSetup(seed, seconds)
        text = setup.config_text(autopilot_port=14540, ground_port=14550)
        self._folder = folder
        self._arguments = [*setup.mock_arguments(parse(text, CONFIG_FILE)), *(f"--set={each}" for each in FLIGHT)]
        folder.mkdir(parents=True, exist_ok=True)
        (folder / CONFIG_FILE).write_text(text, encoding="utf-8")
        camera = files("fwav_companion.cli.templates") / CAMERA_FILE
        (folder / CAMERA_FILE).write_text(camera.read_text(encoding="utf-8"), encoding="utf-8")
        self.config: Config = load(folder / CONFIG_FILE)

    def recorded(self) -> Recording:
        """The flight's telemetry and frames, flown in simulated time."""
        _run(MOCK, [*self._arguments, "--record", str(self._folder)])
        telemetry = load_telemetry(self._folder / "telemetry.tlog", own_components(self.config))
        detections = (self._folder / "detections.jsonl").read_bytes()
        return join(telemetry, detections, own_components(self.config), self.config.vehicle.system_id)

    @contextmanager
    def pictures(self, first: int) -> Iterator[Iterator[tuple[int, Pixels]]]:
        """(number, grey levels) of the frames from this one on, rendered by another process as they are read."""
        command = [sys.executable, "-m", EYE, *self._arguments, "--unpaced", f"--frame={first}"]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:  # noqa: S603  # our own module
            try:
                yield _pictures(process.stdout) if process.stdout is not None else iter(())
            finally:
                process.kill()

    def spot(self, frame: int, pixel: tuple[float, float]) -> TrueSpot | None:
        """The spot at a pixel of a frame, and its place in all others; None if that pixel does not show ground."""
        words = ["--frame", str(frame), "--pixel", *(f"{value:.4f}" for value in pixel)]
        try:
            return msgspec.json.decode(_run(SPOT, [*self._arguments, *words]), type=TrueSpot)
        except subprocess.CalledProcessError:
            return None


def _run(module: str, arguments: Sequence[str]) -> bytes:
    command = [sys.executable, "-m", module, *arguments]
    done = subprocess.run(command, capture_output=True, timeout=RECORDING_S, check=True)  # noqa: S603  # our own module
    return done.stdout


def _pictures(stream: IO[bytes]) -> Iterator[tuple[int, Pixels]]:
    while line := stream.readline():
        header = json.loads(line)
        width, height = header["size"]
        data = stream.read(width * height)
        if len(data) < width * height:
            return
        yield header["frame"], np.frombuffer(data, np.uint8).reshape(height, width)
