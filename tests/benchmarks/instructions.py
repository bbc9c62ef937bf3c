"""Instructions of the estimator and of whole replays, by callgrind: a measure that no load of the machine moves.

``python -m tests.benchmarks.instructions`` needs valgrind and a quarter of an hour. What is counted by itself is
called by an iterator written in C that nothing else uses, so that callgrind's file has its inclusive cost.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import compress, dropwhile, starmap, takewhile
from pathlib import Path
from typing import NamedTuple, TypeVar

from fwav_companion.estimation.solve import Estimate, SolveTask
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.tracking.reorder import Reorder
from fwav_companion.types import FrameView, NoFrame, Track
from tests.accuracy.flights import Plan, plan_of, recording_of, replayed

WINDOW_NS = 10 * NS_PER_S
"""Time of a flight whose instructions are written to a file of their own."""
NEXT_WINDOW = "compress_next"
"""The interpreter's C function at whose call callgrind writes them."""
TRACKER, SOLVE, SEARCH = "takewhile_next", "starmap_next", "dropwhile_next"
"""C functions that call the tracker's frames, and within them the solves without and with a delay search."""
MODULE = "tests.benchmarks.instructions"
Result = TypeVar("Result")


@dataclass(frozen=True)
class CountedFlight:
    """A flight by kind and time; its seed is the first one."""

    kind: str
    seconds: float
    targets_m: tuple[tuple[float, float], ...] = ()
    """Places of the targets, m north and east of the flight's centre; empty: the kind's own."""

    def plan(self) -> Plan:
        """The flight before it is flown."""
        plan = plan_of(self.kind, 1)
        options = plan.options.but({"seconds": self.seconds})
        if self.targets_m:
            first = options.targets[0]
            options = options.but({"targets": tuple(replace(first, north=n, east=e) for n, e in self.targets_m)})
        return replace(plan, name=f"{plan.name}-{self.seconds:.0f}s-{len(options.targets)}", options=options)


class Spent(NamedTuple):
    """Million instructions."""

    whole: float
    tracker: float
    solves: float
    searches: float
    """Of solves with a search of the delay."""


def spent(flight: str, estimator: str, folder: Path) -> tuple[list[Spent], Counter[str]]:
    """Instructions of each window of a flight's replay, and the calls of each counted function."""
    recording_of(FLIGHTS[flight].plan(), folder)  # else the counted process would fly it
    calls: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "out"
        command = [
            "valgrind", "--tool=callgrind", "--compress-strings=no", "--compress-pos=no",
            f"--dump-before={NEXT_WINDOW}", f"--callgrind-out-file={out}", sys.executable, "-m", MODULE, flight,
            estimator, str(folder),
        ]  # fmt: skip
        environment = {**os.environ, "PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"callgrind: {done.stderr[-800:]}")
        parts = sorted(Path(name).glob("out.*"), key=lambda path: int(path.suffix[1:]))
        windows = []
        for path in [*parts[1:], out]:  # before the first one the recording is read
            by_function = _inclusive(path, calls)
            windows.append(Spent(*(by_function[each] / 1e6 for each in ("", TRACKER, SOLVE, SEARCH))))
    return windows, calls


def _inclusive(path: Path, calls: Counter[str]) -> Counter[str]:
    """Instructions by counted function, and of all by "", in a file of callgrind; adds the number of calls."""
    found: Counter[str] = Counter()
    function, called = "", ""
    for line in path.read_text().splitlines():
        if line.startswith("fn="):
            function = line[3:]
        elif line.startswith("cfn="):
            called = line[4:]
        elif line.startswith("calls="):
            if called in (TRACKER, SOLVE, SEARCH):
                calls[called] += int(line[6:].split()[0])
        elif function in (TRACKER, SOLVE, SEARCH) and line[:1].isdigit():
            found[function] += int(line.split()[1])
        elif line.startswith("totals:"):
            found[""] = int(line.split()[1])
    return found


def counted(function: str, work: Callable[[], Result]) -> Result:
    """The result of work that an iterator written in C calls."""
    results: list[Result] = []

    def call(_: object) -> bool:
        results.append(work())
        return function == TRACKER

    iterators = {TRACKER: takewhile(call, (0,)), SOLVE: starmap(call, ((0,),)), SEARCH: dropwhile(call, (0,))}
    next(iterators[function])
    return results[0]


def next_window() -> None:
    """Callgrind writes what it has counted."""
    next(compress((0,), (1,)))


def replay_counted(flight: str, estimator: str, folder: str) -> None:
    """Replays a flight; what callgrind counts."""
    put, run = Reorder.put, SolveTask.run
    until_ns: list[int] = []

    def counted_put(self: Reorder, view: FrameView, now_ns: HostNs) -> tuple[Track, ...] | NoFrame:
        if not until_ns or view.host_ns >= until_ns[-1]:
            until_ns.append((until_ns[-1] if until_ns else view.host_ns) + WINDOW_NS)
            if len(until_ns) > 1:
                next_window()
        return counted(TRACKER, lambda: put(self, view, now_ns))

    def counted_run(task: SolveTask) -> Estimate:
        return counted(SEARCH if task.search else SOLVE, lambda: run(task))

    Reorder.put, SolveTask.run = counted_put, counted_run  # type: ignore[method-assign]
    lines = replayed(FLIGHTS[flight].plan(), recording_of(FLIGHTS[flight].plan(), Path(folder)), estimator)
    next_window()
    for _ in lines:
        pass


_SPREAD = tuple((3.0 * (k % 8) - 10.5, 3.0 * (k // 8) - 10.5) for k in range(64))
FLIGHTS = {
    "one": CountedFlight("orbit_1", 60.0),
    "short": CountedFlight("orbit_1", 4.0),
    "ten": CountedFlight("targets_10", 20.0),
    "64": CountedFlight("targets_10", 20.0, _SPREAD),
    "eight": CountedFlight("eight_late_and_crooked", 45.0),
}

if __name__ == "__main__":
    replay_counted(*sys.argv[1:])
