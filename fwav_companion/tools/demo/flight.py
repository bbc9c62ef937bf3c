"""One demonstration: starts everything, watches it until the flight is over, and says what came of it."""

from __future__ import annotations

import os
import socket
import stat
import time
from collections.abc import Callable
from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

from fwav_companion.config import parse
from fwav_companion.errors import InputFileError
from fwav_companion.tools.demo.children import Child
from fwav_companion.tools.demo.following import GrowingLines, newest_object
from fwav_companion.tools.demo.ground_station import GroundStation
from fwav_companion.tools.demo.scoreboard import Score, Scoreboard
from fwav_companion.tools.demo.setting import CAMERA_FILE, CONFIG_FILE, PIPE, Setting

COMES_UP_S = 30.0
"""A slow board's Python needs some seconds."""
BEFORE_FLIGHT_S = 3.0
"""The ground is painted before the camera can look at it."""
STEP_S = 0.2
SETTLES_S = 1.2
"""After the last picture: half a second until its lines are settled, and what a busy machine adds."""
PATH_HZ = 10.0
"""How often the mock tells where the vehicle is, for the map."""
MOCK_MODULE, EYE_MODULE = "sitl_mock", "sitl_mock.eye"


class Moment(msgspec.Struct, frozen=True):
    """What a watcher may show."""

    flown_s: float
    """Negative: before the start."""
    scores: list[Score]
    status: dict[str, Any]
    """The service's status file."""
    rates_hz: dict[str, float]
    """Of what the ground station hears from the companion."""
    place: dict[str, float] | None
    texts: list[str]
    clock: dict[str, Any] | None
    pictures: int
    pictures_left_out: int


class Outcome(msgspec.Struct, frozen=True):
    """What came of it."""

    scores: list[Score]
    troubles: list[str]
    """Empty: all is well."""
    recording: Path | None
    heard: dict[str, int]
    texts: list[str]

    def as_json(self) -> dict[str, Any]:
        """The object that ``--json`` prints."""
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
        return {"ok": not self.troubles, "targets": targets, "troubles": self.troubles}


class Demonstration:
    """In a folder of its own."""

    def __init__(self, setting: Setting, out: Path) -> None:
        self._setting, self._out = setting, out
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
        """What the mock was told, to ask it for the same flight again."""
        return self._flight_arguments

    def fly(self, watch: Callable[[Moment], None]) -> Outcome:
        """The whole flight in real time, in a folder that is there; ``watch`` is called a few times a second."""
        with ExitStack() as stack:
            ground = stack.enter_context(GroundStation())
            self._prepare(ground.port)
            service = self._child(stack, "the service", "fwav_companion", ["run", "--config", CONFIG_FILE])
            trouble = self._comes_up(service)
            if trouble is None:
                trouble = self._watch_flight(stack, service, ground, watch)
            service.stop()
            ground.listen()
            self._read()
        troubles = [trouble] if trouble else []
        scores = self._board.scores()
        troubles += [score.trouble for score in scores if score.trouble]
        if not troubles and not any(score.due or score.found for score in scores):
            troubles.append("no tag was in view for long enough: fly longer, as --seconds 30")
        return Outcome(scores, troubles, self._recording, dict(ground.heard), list(ground.texts))

    # Before the flight.

    def _prepare(self, ground_port: int) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        text = self._setting.config_text(self._port, ground_port)
        self._flight_arguments = self._setting.mock_arguments(parse(text, CONFIG_FILE))
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
            raise InputFileError(f"{path}: stands there already; accepted: a folder without it")
        path.unlink(missing_ok=True)
        os.mkfifo(path, 0o600)

    def _child(self, stack: ExitStack, told: str, module: str, arguments: list[str]) -> Child:
        child = Child(told, module, arguments, self._out / f"{told.rpartition(' ')[2]}.log", self._out)
        stack.callback(child.stop)
        return child

    def _comes_up(self, service: Child) -> str | None:
        """None as soon as the service tells its status."""
        deadline = time.monotonic() + COMES_UP_S
        while time.monotonic() < deadline:
            if newest_object(self._out / "status.json").get("pid") == service.pid:
                return None
            if not service.runs:
                return service.trouble() or "the service ended at once"
            time.sleep(STEP_S)
        return f"the service did not come up within {COMES_UP_S:.0f} s"

    # In flight.

    def _watch_flight(
        self, stack: ExitStack, service: Child, ground: GroundStation, watch: Callable[[Moment], None]
    ) -> str | None:
        """Until it is over; what went wrong, if anything did."""
        self._start_ns = time.monotonic_ns() + round(BEFORE_FLIGHT_S * 1e9)
        both = [*self._flight_arguments, f"--start-ns={self._start_ns}"]
        link = [f"--connect=udpout:127.0.0.1:{self._port}", "--truth=truth.jsonl", "--truth-csv=truth.csv"]
        truth = f"--set=truth_hz={PATH_HZ}"
        autopilot = self._child(stack, "the mock autopilot", MOCK_MODULE, [*both, *link, truth])
        camera = self._child(stack, "the mock camera", EYE_MODULE, [*both, f"--pipe={PIPE}", "--truth=pictures.jsonl"])
        while (flown_s := self._flown_s()) < self._setting.seconds + SETTLES_S:
            ground.listen()
            self._read()
            status = newest_object(self._out / "status.json")
            watch(self._moment(flown_s, status, ground))
            trouble = self._trouble([service, autopilot, camera], status)
            if trouble is not None:
                return f"{trouble}, {max(0.0, flown_s):.1f} s into the flight"
            time.sleep(STEP_S)
        return None

    def _trouble(self, children: list[Child], status: dict[str, Any]) -> str | None:
        for child in children:
            trouble = child.trouble()
            if trouble is not None:
                return trouble
        if not children[0].runs:
            return "the service ended"
        if self._flown_s() < self._setting.seconds - 1.0:
            gone = next((child for child in children[1:] if not child.runs), None)
            if gone is not None:
                return f"{gone.told} ended before the flight did"
        recording = str(status.get("recording") or "")
        if recording.startswith("recording stopped"):
            return f"the service can keep nothing: {recording}"
        vision = status.get("vision") or {}
        if vision.get("deaths"):
            return f"the vision process ended and the service started another ({vision.get('why') or 'now it works'})"
        return None

    def _flown_s(self) -> float:
        return (time.monotonic_ns() - self._start_ns) * 1e-9

    def _read(self) -> None:
        """What all the others wrote."""
        if self._targets is None:
            self._recording = self._recording_folder()
            self._targets = None if self._recording is None else GrowingLines(self._recording / "targets.jsonl")
        if self._targets is not None:
            self._board.take_targets(self._targets.new())
        self._board.take_truth(self._truth.new())
        self._board.take_pictures(self._pictures.new())

    def _recording_folder(self) -> Path | None:
        told = newest_object(self._out / "status.json").get("recording")
        folder = self._out / str(told) if told else None
        return folder if folder is not None and folder.is_dir() else None

    def _moment(self, flown_s: float, status: dict[str, Any], ground: GroundStation) -> Moment:
        return Moment(
            flown_s,
            self._board.scores(),
            status,
            ground.rates_hz(),
            ground.place,
            list(ground.texts),
            dict(self._board.clock) if self._board.clock else None,
            self._board.pictures[True],
            self._board.pictures[False],
        )


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
