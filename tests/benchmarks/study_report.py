"""The report of a study of 10 000 flights: CPU seconds, which are those of a quiet machine, and memory at its highest.

``python -m tests.benchmarks.study_report``
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np

from fwav_companion.tools.study.causes import CAUSES
from fwav_companion.tools.study.flight_draw import CONFIGURED, TWICE, WITHOUT
from fwav_companion.tools.study.flight_ranking import further_flights
from fwav_companion.tools.study.flight_record import DRAWN, FLOWN, FOUND, POINTS, FlightRecord
from fwav_companion.tools.study.keys import parse_variation
from fwav_companion.tools.study.record_file import FILE, Environment, write_records
from tests.benchmarks.figure import Figure
from tests.benchmarks.study import plan

FLIGHTS = 10_000
VARIED = "flight.height_m"
SECONDS, MEMORY_MIB = 5.0, 400.0
CHILD = """
import resource, sys
from fwav_companion.__main__ import main
from tests.support.peak_memory import peak_kb
status = main(["study", "--report-only", "--out", sys.argv[1]])
used = resource.getrusage(resource.RUSAGE_SELF)
print(used.ru_utime + used.ru_stime, peak_kb() / 1024.0)
sys.exit(status)
"""


def measure() -> list[Figure]:
    """The figures of one report, by a process of its own."""
    with TemporaryDirectory() as folder:
        _write(Path(folder))
        said = subprocess.run([sys.executable, "-c", CHILD, folder], check=True, capture_output=True, text=True).stdout
        size = (Path(folder) / "report.html").stat().st_size
    spent_s, mib = map(float, said.splitlines()[-1].split())
    detail = f"{FLIGHTS} flights, with a varied key; report of {size / 1e6:.1f} MB"
    return [
        Figure("study: report of 10 000 flights, seconds", spent_s, SECONDS, False, detail),
        Figure("study: report of 10 000 flights, MiB", mib, MEMORY_MIB, False, detail),
    ]


def _write(folder: Path) -> None:
    """A study's file, with invented flights: what a report costs does not depend on their values."""
    draw = np.random.default_rng(4)
    study = msgspec.structs.replace(plan(60.0), flights=FLIGHTS, variations=(parse_variation(f"{VARIED}=5:40"),))
    further = (TWICE, f"{WITHOUT}position", f"{WITHOUT}mount")
    arms = [(CONFIGURED, FLIGHTS), *((arm, further_flights(FLIGHTS)) for arm in further)]
    records = [_record(draw, index, arm) for arm, count in arms for index in range(count)]
    write_records(folder / FILE, records, study, Environment(("a processor",), {"numpy": "2"}))


def _record(draw: np.random.Generator, index: int, arm: str) -> FlightRecord:
    north, east = draw.normal(0.0, 1.0, 2).tolist()
    error = float(np.hypot(north, east))
    height = float(draw.uniform(5.0, 40.0))
    return FlightRecord(
        index=index, arm=arm, varied={VARIED: height}, flown=dict.fromkeys(FLOWN, 1.0) | {"height_m": height},
        drawn=dict.fromkeys(DRAWN, 0.1), state=FOUND, no_answer="", error_m=error, north_error_m=north,
        east_error_m=east, claimed95_m=2.4477, normalised2=error**2, errors_m=draw.normal(1.0, 0.1, POINTS).tolist(),
        claims95_m=[2.4477] * POINTS, squares=draw.exponential(2.0, POINTS).tolist(), calibration="calibrated",
        calibrated_s=20.0, limits_m=dict.fromkeys(CAUSES, 0.1),
    )  # fmt: skip


if __name__ == "__main__":
    print(*measure(), sep="\n")
