"""Latency from a detection to its LANDING_TARGET while the smoother solves without a pause, against the median without.

The daemon is a process of its own, with the smoother and ten targets. In one flight its thread computes each solve
again and again until the next one; in the other it solves once in some seconds, and the median frame meets no solve.
``python -m tests.benchmarks.solving``
"""

from __future__ import annotations

from statistics import median, quantiles

from tests.benchmarks.daemon import LATE_S, MEASURED_S, watch
from tests.benchmarks.figure import Figure

DAEMON = """
import asyncio, os, sys
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"
from fwav_companion.config import load
from fwav_companion.service.background_solver import BackgroundJob, BackgroundSolver
from fwav_companion.service.configured_files import load_calibration
from fwav_companion.service.daemon import Service

class BusyJob(BackgroundJob):
    def __init__(self, task):
        super().__init__(task)
        self.task = task
    def compute(self):
        super().compute()
        while not self.cancelled:
            BackgroundJob(self.task).compute()

class Busy(BackgroundSolver):
    job_type = BusyJob

config = load("flight.toml")
solver = {"busy": Busy, "usual": BackgroundSolver}[sys.argv[1]]()
asyncio.run(Service(config, load_calibration(config), None, elevation=(), extra_files={}, solver=solver).run())
"""


def latencies_s(solves: str) -> list[float]:
    """Latencies of one flight; ``solves``: busy or usual."""
    found = watch(calibrates=True, ten_sent_after_s=LATE_S, daemon_command=("-c", DAEMON, solves)).latencies_s
    if len(found) < MEASURED_S:
        raise AssertionError("no landing target came back")
    return found


def measure() -> list[Figure]:
    """Two flights, about a minute."""
    without_s, busy_s = median(latencies_s("usual")), latencies_s("busy")
    p99_s = quantiles(busy_s, n=100)[98]
    detail = (
        f"median without {without_s * 1e3:.2f} ms; while solving median {median(busy_s) * 1e3:.2f} ms, p99"
        f" {p99_s * 1e3:.2f} ms, of {len(busy_s)} frames of ten detections"
    )
    return [
        Figure("detection to datagram while solving, p99 in the median without", p99_s / without_s, 2.0, False, detail)
    ]


if __name__ == "__main__":
    print(*measure(), sep="\n")
