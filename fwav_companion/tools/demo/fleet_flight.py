"""A fleet on one machine: a mock and a service for each vehicle, and one ground process that fuses their tracks."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

from fwav_companion.config import parse
from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import made_folder
from fwav_companion.tools.demo.fleet_score import FusedScore, fleet_scores
from fwav_companion.tools.demo.flight_setup import CAMERA_FILE, CONFIG_FILE, mock_priors
from fwav_companion.tools.demo.processes import ChildProcess, GrowingLines, newest_object

TARGETS = ("5,3", "-6,2", "1,-6", "-3,9", "9,-4")
"""Places of persons, metres from the flight centre. All have one label, so that only their places distinguish them."""
COMES_UP_S = 40.0
STEP_S = 0.5
SETTLES_S = 1.5
"""Time after the flight until its last messages are fused."""
FLEET = "demo"


class FleetResult(msgspec.Struct, frozen=True):
    """The result of a demonstration with a fleet."""

    scores: list[FusedScore]
    ghosts: int
    """Number of fused targets without a true target."""
    troubles: list[str]
    """Reasons for exit status 1; empty: success."""

    def as_json(self) -> dict[str, Any]:
        """The object that ``--json`` prints."""
        return {
            "ok": not self.troubles,
            "targets": msgspec.to_builtins(self.scores),
            "ghosts": self.ghosts,
            "troubles": self.troubles,
        }


class FleetDemonstration:
    """One flight of several vehicles."""

    def __init__(self, vehicles: int, seconds: float, seed: int, out: Path) -> None:
        self._vehicles, self._seconds, self._seed, self._out = vehicles, seconds, seed, out
        self._http, self._bus, self._mavlink = (_free_port(kind) for kind in ("tcp", "tcp", "udp"))
        self._fused: dict[str, dict[str, Any]] = {}

    @property
    def address(self) -> str:
        """The page's address."""
        return f"http://127.0.0.1:{self._http}/"

    def fly(self, watch: Callable[[float, int], None]) -> FleetResult:
        """Fly in real time and return the result. ``watch``: called with seconds flown and fused targets."""
        with ExitStack() as stack:
            children = [self._ground(stack)]
            folders = [self._folder(number) for number in range(1, self._vehicles + 1)]
            ports = [(_free_port("udp"), _free_port("udp")) for _ in folders]
            for number, (folder, at) in enumerate(zip(folders, ports, strict=True), 1):
                children.append(self._service(stack, number, folder, at))
            trouble = self._wait(children, folders)
            if trouble is None:
                for number, (folder, at) in enumerate(zip(folders, ports, strict=True), 1):
                    children.append(self._mock(stack, number, folder, at))
                trouble = self._watch(children, watch)
        scores, ghosts = fleet_scores(_truth(folders[0]), list(self._fused.values())) if trouble is None else ([], 0)
        troubles = [trouble] if trouble is not None else [each.trouble for each in scores if each.trouble is not None]
        if ghosts:
            troubles.append(f"{ghosts} fused targets where nothing is")
        return FleetResult(scores, ghosts, troubles)

    def _folder(self, number: int) -> Path:
        folder = self._out / f"vehicle-{number}"
        try:
            made_folder(folder)
            for name in ("status.json", "truth.jsonl"):
                (folder / name).unlink(missing_ok=True)
            camera = files("fwav_companion.cli.templates") / CAMERA_FILE
            (folder / CAMERA_FILE).write_text(camera.read_text(encoding="utf-8"), encoding="utf-8")
        except OSError as error:
            raise InputFileError(f"{error.filename}: {error.strerror}; accepted: a folder to write to") from None
        return folder

    def _ground(self, stack: ExitStack) -> ChildProcess:
        words = ["ground", "--fleet", FLEET, "--listen", f"tcp/127.0.0.1:{self._bus}", "--record", "picture"]
        words += ["--http", f"127.0.0.1:{self._http}", "--link", f"udpin://127.0.0.1:{self._mavlink}"]
        for old in (self._out / "picture").glob("ground-*.jsonl"):
            old.unlink()
        return _child(stack, "the ground process", "fwav_companion", words, self._out / "ground.log")

    def _service(self, stack: ExitStack, number: int, folder: Path, ports: tuple[int, int]) -> ChildProcess:
        (folder / CONFIG_FILE).write_text(self._config_text(ports), encoding="utf-8")
        words = ["run", "--config", CONFIG_FILE]
        return _child(stack, f"the service of vehicle {number}", "fwav_companion", words, folder / "service.log")

    def _config_text(self, ports: tuple[int, int]) -> str:
        return f"""\
# One vehicle of the demonstration's fleet.

[[link]]
name = "autopilot"
url = "udpin://127.0.0.1:{ports[0]}"
role = "autopilot"

[[link]]
name = "ground"
url = "udpout://127.0.0.1:{self._mavlink}"
role = "gcs"

[camera]
calibration = "{CAMERA_FILE}"

[detections]
url = "udpin://127.0.0.1:{ports[1]}"

[fleet]
name = "{FLEET}"
connect = ["tcp/127.0.0.1:{self._bus}"]

[status]
file = "status.json"
"""

    def _mock(self, stack: ExitStack, number: int, folder: Path, ports: tuple[int, int]) -> ChildProcess:
        chosen: dict[str, Any] = mock_priors(parse(self._config_text(ports), CONFIG_FILE))
        phase = 360.0 * (number - 1) / self._vehicles
        chosen |= {"autopilot.system_id": number, "flight.start_phase_deg": phase, "flight.height_m": 11.0 + number}
        words = [f"--set={name}={value!r}" for name, value in chosen.items()]
        words += [f"--target=person,{place}" for place in TARGETS]
        words += [f"--seed={self._seed * 100 + number}", f"--seconds={self._seconds}", "--truth=truth.jsonl"]
        words += [f"--connect=udpout:127.0.0.1:{ports[0]}", f"--detections=127.0.0.1:{ports[1]}"]
        return _child(stack, f"the mock of vehicle {number}", "sitl_mock", words, folder / "mock.log")

    def _wait(self, children: list[ChildProcess], folders: list[Path]) -> str | None:
        """Wait until everything runs; the trouble if it does not."""
        deadline = time.monotonic() + COMES_UP_S
        while time.monotonic() < deadline:
            trouble = _trouble(children)
            if trouble is not None:
                return trouble
            if all(newest_object(folder / "status.json") for folder in folders) and self._recording() is not None:
                return None
            time.sleep(STEP_S)
        return f"not everything came up within {COMES_UP_S:.0f} s"

    def _watch(self, children: list[ChildProcess], watch: Callable[[float, int], None]) -> str | None:
        """Watch until the flight is over; the trouble if there is one."""
        path = self._recording()
        lines = GrowingLines(path) if path is not None else None
        start_s = time.monotonic()
        while (flown_s := time.monotonic() - start_s) < self._seconds + SETTLES_S:
            trouble = _trouble(children)
            if trouble is not None:
                return f"{trouble}, {flown_s:.1f} s into the flight"
            for line in () if lines is None else lines.new_objects():
                if line["type"] == "picture" and flown_s < self._seconds:
                    self._take(line["update"])
            watch(flown_s, len(self._fused))
            time.sleep(STEP_S)
        return None

    def _take(self, update: dict[str, Any]) -> None:
        """Process an update that the ground process has recorded."""
        for gone in update["removed"]:
            self._fused.pop(gone, None)
        for target in update["targets"]:
            if target["source"] == "fused":
                self._fused[target["id"]] = target

    def _recording(self) -> Path | None:
        return next(iter((self._out / "picture").glob("ground-*.jsonl")), None)


def _child(stack: ExitStack, name: str, module: str, words: list[str], log: Path) -> ChildProcess:
    child = ChildProcess(name, module, words, log)
    stack.callback(child.stop)
    return child


def _trouble(children: list[ChildProcess]) -> str | None:
    return next((trouble for child in children if (trouble := child.trouble()) is not None), None)


def _truth(folder: Path) -> dict[str, Any]:
    """The mock's first line: the true targets."""
    with (folder / "truth.jsonl").open(encoding="utf-8") as file:
        header: dict[str, Any] = json.loads(file.readline())
    return header


def _free_port(kind: str) -> int:
    """A port that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM if kind == "udp" else socket.SOCK_STREAM) as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
    return port
