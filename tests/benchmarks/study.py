"""Studies: what Dask adds to a flight, what a second worker gains, and whether a worker's memory stays flat.

``python -m tests.benchmarks.study``
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from importlib.resources import files

import psutil

from fwav_companion.camera import parse_calibration
from fwav_companion.tools.study.cluster import Workers, workers
from fwav_companion.tools.study.flight_worker import FlightWorker, fly_on_worker
from fwav_companion.tools.study.study_plan import StudyPlan, radial_lens
from tests.benchmarks.figure import Figure

SECONDS = 60.0
"""A flight against which the overhead counts."""
EMPTY = 10
"""Pieces of work that only wait as long as a flight takes: what they cost is the engine's."""
SHORT_S, SHORT = 15.0, 12
"""Flights of the speed-up."""
TINY_S, TINY = 2.0, 120
"""Flights of a worker whose memory is watched: a hundred after the first twenty."""
WARM = 20
OVERHEAD, SPEED_UP, GROWTH = 0.05, 1.8, 1.03
CONFIGURATION = "fwav-companion.toml"


def plan(seconds: float) -> StudyPlan:
    """Figure eights by the template's configuration."""
    templates = files("fwav_companion.cli.templates")
    lens = radial_lens(parse_calibration((templates / "camera.yaml").read_text(), "camera.yaml").lens)
    text = (templates / CONFIGURATION).read_text()
    return StudyPlan(
        config=text, config_name=CONFIGURATION, lens=lens, flights=1, seconds=seconds, pattern="eight", seed=1
    )


def waits(_state: object, _index: int, seconds: float) -> bytes:
    """A piece of work that costs nothing."""
    time.sleep(seconds)
    return b"{}"


def measure() -> list[Figure]:
    """The three figures."""
    return [*_engine(), _memory()]


def _engine() -> Iterator[Figure]:
    worker = FlightWorker(plan(SECONDS))
    worker.fly(0, "configured")  # starts the mock, and imports what a flight needs
    flight_s = _cpu_of(lambda: worker.fly(1, "configured"))
    worker.close()
    with workers(count=1) as one:
        _run(one, 2)
        waiting = [(i, flight_s) for i in range(EMPTY)]
        empty_s = _cpu_of(lambda: list(one.run(waits, waiting, dict, ()))) / EMPTY
        alone_s = _run(one, SHORT)
    yield Figure(
        "study: Dask per flight / a flight of 60 s, CPU", empty_s / flight_s, OVERHEAD, False,
        f"{1e3 * empty_s:.1f} ms of {flight_s:.2f} s",
    )  # fmt: skip
    with workers(count=2) as two:
        _run(two, 4)
        both_s = _run(two, SHORT)
    yield Figure(
        "study: two workers / one", alone_s / both_s, SPEED_UP, True,
        f"{alone_s:.1f} s and {both_s:.1f} s for {SHORT} flights; {len(os.sched_getaffinity(0))} cores",
    )  # fmt: skip


def _run(connected: Workers, flights: int) -> float:
    """Wall seconds of short flights."""
    begun = time.monotonic()
    tasks = [(i, "configured") for i in range(flights)]
    for _ in connected.run(fly_on_worker, tasks, FlightWorker, (plan(SHORT_S),)):
        pass
    return time.monotonic() - begun


def _memory() -> Figure:
    worker, process, sizes = FlightWorker(plan(TINY_S)), psutil.Process(), list[int]()
    for index in range(TINY):
        worker.fly(index, "configured")
        sizes.append(sum(each.memory_info().rss for each in (process, *process.children())))
    worker.close()
    return Figure(
        f"study: memory of a worker after {TINY} flights / after {WARM}", sizes[-1] / sizes[WARM - 1], GROWTH, False,
        f"{sizes[WARM - 1] / 2**20:.0f} and {sizes[-1] / 2**20:.0f} MiB",
    )  # fmt: skip


def _cpu_of(work: Callable[[], object]) -> float:
    """CPU seconds of this process and of all below it."""
    before = _cpu_s()
    work()
    return _cpu_s() - before


def _cpu_s() -> float:
    process = psutil.Process()
    spent = 0.0
    for each in (process, *process.children(recursive=True)):
        times = each.cpu_times()
        spent += times.user + times.system
    return spent


if __name__ == "__main__":
    print(*measure(), sep="\n")
