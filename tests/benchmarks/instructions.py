"""Instructions of the estimator and of whole replays, by callgrind: a measure that no load of the machine moves.

``python -m tests.benchmarks.instructions`` needs valgrind and a quarter of an hour. What is counted by itself is
called by an iterator written in C that nothing else uses, so that callgrind's file has its inclusive cost.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import compress, dropwhile, starmap, takewhile
from pathlib import Path
from statistics import fmean
from typing import NamedTuple, TypeVar

from fwav_companion.estimation.solve import Estimate, SolveTask
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.tracking.reorder import Reorder
from fwav_companion.types import FrameView, NoFrame, Track
from tests.accuracy.flights import Plan, plan_of, recording_of, replayed
from tests.benchmarks.figure import Figure

WINDOW_S = 10
"""Time of a flight whose instructions are written to a file of their own; flights are multiples of it."""
NEXT_WINDOW = "compress_next"
"""The interpreter's C function at whose call callgrind writes them."""
TRACKER, SOLVE, SEARCH = "takewhile_next", "starmap_next", "dropwhile_next"
"""C functions that call the tracker's frames, and within them the solves without and with a delay search."""
CHECKOUT, MODULE = Path(__file__).parents[2], "tests.benchmarks.instructions"
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
    """Million instructions a flight second."""

    whole: float
    tracker: float
    solves: float
    searches: float
    """Of solves with a search of the delay."""


def spent(flight: str, estimator: str, folder: Path) -> list[Spent]:
    """Million instructions a second in each window of a flight's replay."""
    recording_of(FLIGHTS[flight].plan(), folder)  # else the counted process would fly it
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "out"
        command = [
            "valgrind", "--tool=callgrind", "--compress-strings=no", "--compress-pos=no",
            f"--dump-before={NEXT_WINDOW}", f"--callgrind-out-file={out}", sys.executable, "-m", MODULE, flight,
            estimator, str(folder),
        ]  # fmt: skip
        environment = {**os.environ, "PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(command, env=environment, cwd=CHECKOUT, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"callgrind: {done.stderr[-800:]}")
        parts = sorted(Path(name).glob("out.*"), key=lambda path: int(path.suffix[1:]))
        windows = []
        for path in [*parts[1:], out]:  # before the first one the recording is read
            by_function = inclusive(path)
            windows.append(Spent(*(by_function[each] / 1e6 / WINDOW_S for each in ("", TRACKER, SOLVE, SEARCH))))
    return windows


def inclusive(path: Path) -> Counter[str]:
    """Instructions by counted function, and of all by "", in a file of callgrind."""
    found: Counter[str] = Counter()
    function = ""
    for line in path.read_text().splitlines():
        if line.startswith("fn="):
            function = line[3:]
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
            until_ns.append((until_ns[-1] if until_ns else view.host_ns) + WINDOW_S * NS_PER_S)
            if 1 < len(until_ns) <= FLIGHTS[flight].seconds / WINDOW_S:  # the end is the last one's
                next_window()
        return counted(TRACKER, lambda: put(self, view, now_ns))

    def counted_run(task: SolveTask) -> Estimate:
        return counted(SEARCH if task.search else SOLVE, lambda: run(task))

    Reorder.put, SolveTask.run = counted_put, counted_run  # type: ignore[method-assign]
    lines = replayed(FLIGHTS[flight].plan(), recording_of(FLIGHTS[flight].plan(), Path(folder)), estimator)
    next_window()
    for _ in lines:
        pass


def measure() -> list[Figure]:
    """Three flights; none without valgrind, which no package index has."""
    if shutil.which("valgrind") is None:
        return []
    with tempfile.TemporaryDirectory() as name:
        one, ten, many = (spent(flight, "third", Path(name)) for flight in FLIGHTS)
    begin, later = one[:2], one[2:]
    mean = Spent(*(fmean(column) for column in zip(*one, strict=True)))
    detail = (
        f"{mean.solves:.0f} of them in solves, {mean.searches:.0f} with searches; the whole replay {mean.whole:.0f}"
    )
    return [
        _figure("one target over a minute", mean.tracker, 80.0, detail),
        _figure("the first 20 s of it", fmean(each.tracker for each in begin), 110.0),
        _figure("the dearest later 10 s", max(each.tracker for each in later), 95.0),
        _figure("ten targets", fmean(each.tracker for each in ten), 140.0),
        _figure("64 targets, of which ten teach", fmean(each.tracker for each in many), 250.0),
    ]


def _figure(name: str, million: float, budget: float, detail: str = "association and solves included") -> Figure:
    return Figure(f"estimator, million instructions a flight second: {name}", million, budget, False, detail)


FLIGHTS = {
    "one": CountedFlight("orbit_1", 60.0),
    "ten": CountedFlight("targets_10", 20.0),
    "many": CountedFlight("targets_10", 20.0, tuple((3.0 * (k % 8) - 10.5, 3.0 * (k // 8) - 10.5) for k in range(64))),
}
"""At 30 frames/s, every target in view of nearly every picture."""

if __name__ == "__main__":
    if len(sys.argv) > 1:
        replay_counted(*sys.argv[1:])
    else:
        print(*measure(), sep="\n")
