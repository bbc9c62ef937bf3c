"""Instructions of telemetry/clock and of the rates in one flight of 60 s: this version against the one before 27 Nov.

The flight is the mock's, with TIMESYNC answered and a station that asks for rates. What is asked of ``Clock`` and
``Rates`` in it is noted, by each version for itself, and done again under callgrind, less a run that only reads.
Run from the folder of the project, with its history and valgrind: ``python tests/telemetry/clock_instructions.py``.
"""

from __future__ import annotations

import functools
import os
import pickle
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

BEFORE = "04808c00^"
"""The last commit with three estimators of the clock."""
SECONDS = 60.0
TREE = Path(__file__).resolve().parents[2]
NOTED = {
    "Clock": ("__init__", "on_request", "on_exchange", "on_arrival", "skip", "reset", "host_from_boot",
              "boot_from_host", "sigma_s_at", "rate_at", "estimate"),
    "Rates": ("__init__", "adopt", "want", "ask_again", "on_message", "on_rate_request_passed", "stations_want",
              "on_merged_requests", "on_wake", "open_gate", "notices", "status"),
}  # fmt: skip


def main(order: str, file: str) -> None:
    """``note``: fly and write the calls to a file. ``do``, ``read``: do the calls of a file again, or only read it."""
    from fwav_companion.mavlink.client.rates import Rates
    from fwav_companion.telemetry.clock.clock import Clock

    rooms = {"Clock": Clock, "Rates": Rates}
    if order == "note":
        Path(file).write_bytes(pickle.dumps(_noted(rooms)))
        return
    calls, gate = pickle.loads(Path(file).read_bytes())
    if order == "do":
        objects: dict[str, Any] = {name: room.__new__(room) for name, room in rooms.items()}
        for room, name, arguments, named in calls:
            getattr(objects[room], name)(*arguments, **named)
            if room == "Rates" and name == "__init__" and hasattr(objects[room], "gate"):
                objects[room].gate = functools.partial(_next, iter(gate))


def _next(answers: Iterator[bool], _now: int) -> bool:
    return next(answers, True)


def _noted(rooms: dict[str, Any]) -> tuple[list[tuple[str, str, Any, Any]], list[bool]]:
    """The calls of the rooms in one flight, and what the gate of the rates answered."""
    calls: list[tuple[str, str, Any, Any]] = []
    gate: list[bool] = []
    inside = [False]

    def noting(room: str, name: str, function: Any) -> Any:
        @functools.wraps(function)
        def noted(self: Any, *arguments: Any, **named: Any) -> Any:
            if inside[0]:
                return function(self, *arguments, **named)
            calls.append((room, name, tuple(_plain(each) for each in arguments), named))
            asked = getattr(self, "gate", None) if name == "on_wake" else None
            if asked is not None:
                self.gate = lambda now: gate.append(asked(now)) or gate[-1]
            inside[0] = True
            try:
                return function(self, *arguments, **named)
            finally:
                inside[0] = False
                if asked is not None:
                    self.gate = asked

        return noted

    for room, names in NOTED.items():
        for name in names:
            if hasattr(rooms[room], name):
                setattr(rooms[room], name, noting(room, name, getattr(rooms[room], name)))

    from merged_network import MergedNetwork, Station

    from sitl_mock import scenario

    station = Station("ground").ask_group(6.0, 0, 4).ask(20.0, "ATTITUDE", 20.0)
    options = scenario("arducopter").but({"seconds": SECONDS, "seed": 3, "camera.enabled": False})
    MergedNetwork(options, [station]).fly()
    return calls, gate


def _plain(value: Any) -> Any:
    """A message whose fields can be written to a file."""
    if not hasattr(value, "fields"):
        return value
    import msgspec

    fields = value.fields
    names = getattr(fields, "_fields", None) or fields.__struct_fields__
    return msgspec.structs.replace(value, fields=SimpleNamespace(**{name: getattr(fields, name) for name in names}))


def instructions_m(tree: Path, folder: Path) -> float:
    """Million instructions of both rooms of a version in the flight."""
    file = folder / "calls.pickle"
    environment = {**os.environ, "PYTHONPATH": f"{tree}:{tree}/tests/support", "PYTHONHASHSEED": "0"}
    run = functools.partial(subprocess.run, env=environment, cwd=folder, check=True, capture_output=True, text=True)
    run([sys.executable, __file__, "note", str(file)])
    counts = []
    for order in ("do", "read"):
        command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", sys.executable, __file__, order]
        match = re.search(r"Collected : (\d+)", run([*command, str(file)]).stderr)
        if match is None:
            raise RuntimeError("callgrind counted nothing")
        counts.append(int(match[1]))
    return (counts[0] - counts[1]) / 1e6


def measured() -> str:
    """Both versions, in some minutes."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        before = folder / "before"
        before.mkdir()
        archive = ["git", "-c", "safe.directory=*", "archive", BEFORE, "fwav_companion", "sitl_mock", "tests/support"]
        tar = subprocess.run(archive, cwd=TREE, check=True, stdout=subprocess.PIPE).stdout
        subprocess.run(["tar", "x", "-C", str(before)], input=tar, check=True)
        now_m, before_m = (instructions_m(tree, folder) for tree in (TREE, before))
    return f"{now_m:.0f} of {before_m:.0f} million instructions in {SECONDS:.0f} s: {now_m / before_m:.2f}"


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(*sys.argv[1:])
    else:
        print(measured())
