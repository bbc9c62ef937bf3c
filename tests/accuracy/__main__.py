"""``python -m tests.accuracy``: flies every kind of flight and writes the table, or compares two runs.

Recordings are kept in the folder of ``--cache``: another estimator replays the same bytes. ``--date`` draws the seeds
from a date, so that no code has been tuned to them. With ``--scheduler`` the flights go to a running Dask cluster whose
workers have this checkout; otherwise to processes.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from datetime import date
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import msgspec
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn

from tests.accuracy.flights import COUNTED, ESTIMATORS, instructions_m, scored, seeds_of
from tests.accuracy.kinds import NAMES, RANDOM, RANDOM_FLIGHTS
from tests.accuracy.scores import FlightScore
from tests.accuracy.table import Run, comparison_table, run_table

Task = tuple[str, int, str, Path, int]
"""Kind, seed, estimator, folder of recordings, seed of the random configurations."""


def main() -> int:
    """Fly, or compare."""
    chosen = _arguments()
    if chosen.compare:
        before, after = (msgspec.json.decode(path.read_bytes(), type=Run) for path in chosen.compare)
        print(comparison_table(before, after))
        return 0
    seeds = seeds_of(chosen.seeds, chosen.date)
    random_seed = seeds[0]
    tasks: list[Task] = [
        (kind, seed, chosen.estimator, chosen.cache, random_seed)
        for kind in chosen.kinds
        for seed in (range(RANDOM_FLIGHTS) if kind == RANDOM else seeds)
    ]
    flights: dict[str, list[FlightScore]] = {kind: [] for kind in chosen.kinds}
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns) as progress:
        bar = progress.add_task("flights", total=len(tasks))
        for (kind, *_), score in _results(tasks, chosen.jobs, chosen.scheduler):
            flights[kind].append(score)
            progress.update(bar, advance=1, description=kind)
        counted = [kind for kind in COUNTED if kind in chosen.kinds and chosen.count]
        bar = progress.add_task("callgrind", total=len(counted))
        work = {}
        for kind in counted:
            work[kind] = instructions_m(kind, chosen.estimator, chosen.cache)
            progress.update(bar, advance=1)
    ordered = {kind: sorted(each, key=lambda score: score.seed) for kind, each in flights.items()}
    run = Run(estimator=chosen.estimator, date=chosen.date, commit=_commit(), kinds=ordered, instructions_m=work)
    table = run_table(run)
    if chosen.out:
        chosen.out.with_suffix(".json").write_bytes(_readable(run))
        chosen.out.with_suffix(".md").write_text(table)
    print(table)
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.accuracy", description=(__doc__ or "").partition("\n")[0])
    add = parser.add_argument
    add("--estimator", choices=ESTIMATORS, default="second")
    add("--kinds", nargs="+", choices=NAMES, default=list(NAMES), metavar="KIND", help=", ".join(NAMES))
    add("--seeds", type=int, default=8, metavar="N", help="flights of each kind; default %(default)s")
    add("--date", default="", type=_date, metavar="YYYY-MM-DD", help="draw the seeds from a date; default: 1 to N")
    add("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="processes; default %(default)s")
    add("--scheduler", default="", metavar="ADDRESS", help="fly on a running Dask cluster")
    add("--cache", type=Path, default=Path(tempfile.gettempdir()) / "fwav-accuracy", metavar="FOLDER",
        help="recordings; default %(default)s")  # fmt: skip
    add("--no-count", dest="count", action="store_false", help="without callgrind")
    add("--out", type=Path, metavar="FILE", help="write FILE.json and FILE.md")
    add("--compare", nargs=2, type=Path, metavar=("BEFORE.json", "AFTER.json"), help="compare two runs; flies nothing")
    chosen = parser.parse_args()
    if chosen.seeds < 1 or chosen.jobs < 1:
        parser.error("--seeds and --jobs: expected 1 or more")
    for path in chosen.compare or ():
        if not path.is_file():
            parser.error(f"--compare: no file {path}")
    if not chosen.compare and chosen.count and not shutil.which("valgrind"):
        parser.error("valgrind is not installed: install it, or add --no-count")
    return chosen


def _date(text: str) -> str:
    return date.fromisoformat(text).isoformat() if text else ""


def _results(tasks: list[Task], jobs: int, scheduler: str) -> Iterator[tuple[Task, FlightScore]]:
    """Scores as they are ready."""
    if scheduler:
        from distributed import Client
        from distributed import as_completed as completed

        with Client(scheduler) as client:
            remote = client.map(lambda task: scored(*task), tasks, pure=False)
            which = dict(zip((future.key for future in remote), tasks, strict=True))
            for future, score in completed(remote, with_results=True):
                yield which[future.key], score
        return
    with ProcessPoolExecutor(jobs) as pool:
        waiting = {pool.submit(scored, *task): task for task in tasks}
        for done in as_completed(waiting):
            yield waiting[done], done.result()


def _commit() -> str:
    git = shutil.which("git")
    shown = git and subprocess.run([git, "describe", "--always", "--dirty"], capture_output=True, text=True)
    return shown.stdout.strip() or "unknown" if shown else "unknown"


def _readable(run: Run) -> bytes:
    """JSON with a line for each flight, figures to four digits."""
    encoded = msgspec.json.encode(_rounded(msgspec.to_builtins(run)))
    return encoded.replace(b'{"seed"', b'\n{"seed"') + b"\n"


def _rounded(value: object) -> object:
    if isinstance(value, float):
        return float(f"{value:.4g}")
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    return [_rounded(each) for each in value] if isinstance(value, list) else value


if __name__ == "__main__":
    sys.exit(main())
