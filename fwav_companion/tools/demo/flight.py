"""One demonstration: starts its processes, watches them until the flight is over, and returns the result."""

from __future__ import annotations

import os
import socket
import stat
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

from fwav_companion.config import parse
from fwav_companion.errors import InputFileError
from fwav_companion.recording.line_decoder import read_lines
from fwav_companion.recording.line_types import ClockEstimateLine
from fwav_companion.tools.demo.flight_setup import CAMERA_FILE, CONFIG_FILE, PIPE, FlightSetup
from fwav_companion.tools.demo.ground_station import GroundStation
from fwav_companion.tools.demo.processes import ChildProcess, GrowingLines, newest_object
from fwav_companion.tools.demo.scoreboard import Scoreboard, TargetScore

COMES_UP_S = 30.0
"""Longest start-up time of the service, seconds: Python on a slow board needs several."""
BEFORE_FLIGHT_S, STARTS_BEFORE_FLIGHT, MOST_BEFORE_FLIGHT_S = 3.0, 3.0, 30.0
"""Seconds before the flight in which the mock camera renders the ground: at least the first, at least the second in
start-up times of the service (long on a busy or slow machine: the camera takes 2 s of CPU, the service 0.7 s), at most
the third."""
STEP_S = 0.2
"""Period of the watch loop, seconds."""
SETTLES_S = 1.2
"""Time after the last picture until its lines are written, seconds: the reorder window and a margin."""
MOST_SKIPPED = 0.2
"""Share of skipped pictures above which a busy machine is named as a possible cause of a failure."""
PATH_HZ = 10.0
"""Rate of the true positions of the vehicle, for the map."""
MOCK_MODULE, EYE_MODULE = "sitl_mock", "sitl_mock.eye"


class FlightProgress(msgspec.Struct, frozen=True):
    """The state of the flight at one time."""

    flown_s: float
    """Time since the start, seconds; negative before it."""
    scores: list[TargetScore]
    status: dict[str, Any]
    """The service's status file."""
    rates_hz: dict[str, float]
    """Rates of the companion's messages at the ground station, by name."""
    place: dict[str, float] | None
    """The selected target at the ground station."""
    texts: list[str]
    clock: ClockEstimateLine | None
    """The newest clock line."""
    pictures: int
    pictures_left_out: int
    """Pictures that a busy machine skipped."""


class DemoResult(msgspec.Struct, frozen=True):
    """The result of a demonstration."""

    scores: list[TargetScore]
    troubles: list[str]
    """Reasons for exit status 1; empty: success."""
    recording: Path | None
    heard: dict[str, int]
    """Number of the companion's messages at the ground station, by name."""
    texts: list[str]

    def as_json(self) -> dict[str, Any]:
        """The object that ``--json`` prints; a tag that was not in view for long enough is not in it."""
        shown = [score for score in self.scores if score.due or score.found]
        targets = [
            {
                "id": score.id,
                "found": score.found,
                "error_m": _rounded(score.error_m) if score.found else None,
                "claimed95_m": _rounded(score.claimed95_m) if score.found else None,
                "usable_frames": score.usable_frames,
            }
            for score in shown
        ]
        ghosts = sum(score.ghosts for score in self.scores)
        return {"ok": not self.troubles, "targets": targets, "ghosts": ghosts, "troubles": self.troubles}


class Demonstration:
    """One flight with its processes, in a folder of its own."""

    def __init__(self, setup: FlightSetup, out: Path) -> None:
        self._setup, self._out = setup, out
        self._board = Scoreboard()
        self._start_ns = 0
        self._recording: Path | None = None
        self._targets: GrowingLines | None = None
        self._truth = GrowingLines(out / "truth.jsonl")
        self._pictures = GrowingLines(out / "pictures.jsonl")
        self._port = 0
        self._flight_arguments: list[str] = []

    @property
    def flight_arguments(self) -> list[str]:
        """Arguments of the mock, to repeat the same flight."""
        return self._flight_arguments

    def fly(self, watch: Callable[[FlightProgress], None]) -> DemoResult:
        """Fly in real time and return the result; the folder must exist. ``watch`` is called five times a second."""
        with ExitStack() as stack:
            ground = stack.enter_context(GroundStation())
            self._prepare(ground.port)
            stack.callback((self._out / PIPE).unlink, missing_ok=True)
            service = self._child(stack, "the service", "fwav_companion", ["run", "--config", CONFIG_FILE])
            started_s = time.monotonic()
            trouble = self._comes_up(service)
            if trouble is None:
                before_s = time_before_flight_s(time.monotonic() - started_s)
                self._start_ns = time.monotonic_ns() + round(before_s * 1e9)
                trouble = self._watch_flight(stack, service, ground, watch)
            service.stop()
            ground.listen()
            self._read()
        scores = self._board.scores()
        troubles = [trouble] if trouble else troubles_of(scores, self._board.pictures)
        return DemoResult(
            scores=scores,
            troubles=troubles,
            recording=self._recording,
            heard=dict(ground.heard),
            texts=list(ground.texts),
        )

    def _prepare(self, ground_port: int) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        text = self._setup.config_text(self._port, ground_port)
        self._flight_arguments = self._setup.mock_arguments(parse(text, CONFIG_FILE))
        try:
            for name in ("truth.jsonl", "pictures.jsonl", "status.json"):
                (self._out / name).unlink(missing_ok=True)
            (self._out / CONFIG_FILE).write_text(text, encoding="utf-8")
            camera = files("fwav_companion.cli.templates") / CAMERA_FILE
            (self._out / CAMERA_FILE).write_text(camera.read_text(encoding="utf-8"), encoding="utf-8")
            self._make_pipe(self._out / PIPE)
        except OSError as error:
            raise InputFileError(
                f"{error.filename or self._out}: {error.strerror}; accepted: a folder to write to"
            ) from None

    def _make_pipe(self, path: Path) -> None:
        if path.exists() and not stat.S_ISFIFO(path.stat().st_mode):
            raise InputFileError(f"{path}: exists and is not a pipe; accepted: a folder without it")
        path.unlink(missing_ok=True)
        os.mkfifo(path, 0o600)

    def _child(self, stack: ExitStack, name: str, module: str, arguments: list[str]) -> ChildProcess:
        child = ChildProcess(name, module, arguments, self._out / f"{name.rpartition(' ')[2]}.log")
        stack.callback(child.stop)
        return child

    def _comes_up(self, service: ChildProcess) -> str | None:
        """Wait for the service's status file; the trouble if it does not come."""
        deadline = time.monotonic() + COMES_UP_S
        while time.monotonic() < deadline:
            if newest_object(self._out / "status.json").get("pid") == service.pid:
                return None
            if not service.runs:
                return service.trouble() or "the service ended at once"
            time.sleep(STEP_S)
        return f"the service did not come up within {COMES_UP_S:.0f} s"

    def _watch_flight(
        self, stack: ExitStack, service: ChildProcess, ground: GroundStation, watch: Callable[[FlightProgress], None]
    ) -> str | None:
        """Start the mock and watch until the flight is over; the trouble if there is one."""
        both = [*self._flight_arguments, f"--start-ns={self._start_ns}"]
        link = [f"--connect=udpout:127.0.0.1:{self._port}", "--truth=truth.jsonl", "--truth-csv=truth.csv"]
        truth = f"--set=truth_hz={PATH_HZ}"
        autopilot = self._child(stack, "the mock autopilot", MOCK_MODULE, [*both, *link, truth])
        camera = self._child(stack, "the mock camera", EYE_MODULE, [*both, f"--pipe={PIPE}", "--truth=pictures.jsonl"])
        while (flown_s := self._flown_s()) < self._setup.seconds + SETTLES_S:
            ground.listen()
            self._read()
            status = newest_object(self._out / "status.json")
            watch(self._progress(flown_s, status, ground))
            trouble = self._trouble([service, autopilot, camera], status)
            if trouble is not None:
                return f"{trouble}, {max(0.0, flown_s):.1f} s into the flight"
            time.sleep(STEP_S)
        return None

    def _trouble(self, children: list[ChildProcess], status: dict[str, Any]) -> str | None:
        """A process that failed or ended early, or a service that cannot record or see; None if all is well."""
        for child in children:
            trouble = child.trouble()
            if trouble is not None:
                return trouble
        if not children[0].runs:
            return "the service ended"
        if self._flown_s() < self._setup.seconds - 1.0:
            gone = next((child for child in children[1:] if not child.runs), None)
            if gone is not None:
                return f"{gone.name} ended before the flight did"
        recording = str(status.get("recording") or "")
        if recording.startswith("recording stopped"):
            return f"the service cannot record: {recording}"
        vision = status.get("vision") or {}
        if vision.get("deaths"):
            return f"the vision process ended and the service started another ({vision.get('why') or 'now it works'})"
        return None

    def _flown_s(self) -> float:
        return (time.monotonic_ns() - self._start_ns) * 1e-9

    def _read(self) -> None:
        """Take the new lines of all files."""
        if self._targets is None:
            self._recording = self._recording_folder()
            self._targets = None if self._recording is None else GrowingLines(self._recording / "targets.jsonl")
        if self._targets is not None:
            self._board.take_targets(read_lines(self._targets.new()).lines)
        self._board.take_truth(self._truth.new_objects())
        self._board.take_pictures(self._pictures.new_objects())

    def _recording_folder(self) -> Path | None:
        name = newest_object(self._out / "status.json").get("recording")
        folder = self._out / str(name) if name else None
        return folder if folder is not None and folder.is_dir() else None

    def _progress(self, flown_s: float, status: dict[str, Any], ground: GroundStation) -> FlightProgress:
        return FlightProgress(
            flown_s=flown_s,
            scores=self._board.scores(),
            status=status,
            rates_hz=ground.rates_hz(),
            place=ground.place,
            texts=list(ground.texts),
            clock=self._board.clock,
            pictures=self._board.pictures[True],
            pictures_left_out=self._board.pictures[False],
        )


def troubles_of(scores: Sequence[TargetScore], pictures: Mapping[bool, int]) -> list[str]:
    """Reasons why these scores fail the demonstration: a target was not found, or is beyond its own 99.9 % claim.

    ``pictures``: number of pictures that were delivered (True) and skipped (False).
    """
    found = [score.trouble for score in scores if score.trouble]
    skipped, total = pictures[False], sum(pictures.values())
    busy, unseen = skipped > MOST_SKIPPED * total, not any(score.due or score.found for score in scores)
    if unseen and not busy:
        found = ["no tag was in view for long enough: fly longer, as --seconds 30"]
    if busy and (found or unseen):
        found.append(f"a busy machine skipped {skipped} of {total} pictures: try again when it has less to do")
    return found


def time_before_flight_s(start_up_s: float) -> float:
    """Seconds that the mock camera needs until the first picture, by the service's start-up time on this machine."""
    return min(max(BEFORE_FLIGHT_S, STARTS_BEFORE_FLIGHT * start_up_s), MOST_BEFORE_FLIGHT_S)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
