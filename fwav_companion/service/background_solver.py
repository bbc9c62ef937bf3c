"""SHELL: a thread that computes the smoother's solves, so that no frame, heartbeat or TIMESYNC waits for one.

The interpreter passes its lock on only after the switch interval, 5 ms by default: each time that the loop wakes up,
and after each of its system calls, it would wait that long for a solving thread. While a solve is computed the interval
is therefore short; a switch is made only where the loop asks for it, so that the short interval costs the solve
nothing else. A call of numpy keeps the lock to its end; ``tests/benchmarks/solving.py`` measures what is left.
"""

from __future__ import annotations

import sys
import threading
from collections import deque
from collections.abc import Generator
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from fwav_companion.estimation.solve import Estimate

SWITCH_INTERVAL_S = 1e-4
"""Switch interval while a solve is computed: a tenth of a frame's own processing."""


class SlicedTask(Protocol):
    """A solve in pieces of bounded work."""

    def slices(self) -> Generator[None, None, Estimate]:
        """The pieces; the estimate is the generator's result."""
        ...


class BackgroundJob:
    """A solve that the thread computes, or will compute."""

    __slots__ = ("_estimate", "_failure", "_slices", "cancelled")

    def __init__(self, task: SlicedTask) -> None:
        self._slices = task.slices()
        self._estimate: Estimate | None = None
        self._failure: Exception | None = None
        self.cancelled = False

    def estimate(self) -> Estimate | None:
        """The estimate; None while it is being computed. An exception of the solve is raised here."""
        if self._failure is not None:
            raise self._failure
        return self._estimate

    def compute(self) -> None:
        """All pieces; none after a cancellation. Runs in the thread."""
        try:
            while not self.cancelled:
                next(self._slices)
            self._slices.close()
        except StopIteration as done:
            self._estimate = done.value
        except Exception as error:  # noqa: BLE001  # raised again where the estimate is asked for
            self._failure = error


class BackgroundSolver:
    """Computes one solve at a time in a daemon thread, which starts with the first one."""

    job_type = BackgroundJob

    def __init__(self) -> None:
        self._waiting: deque[BackgroundJob] = deque(maxlen=1)
        self._current: BackgroundJob | None = None
        self._wake = threading.Event()
        self._thread: threading.Thread | None = None
        self._closed = False

    def __call__(self, task: SlicedTask) -> BackgroundJob:
        """Start a solve. One that is under way is cancelled: nothing asks for it any more."""
        job = self.job_type(task)
        if self._current is not None:
            self._current.cancelled = True
        self._current = job
        self._waiting.append(job)
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="solver", daemon=True)
            self._thread.start()
        self._wake.set()
        return job

    def close(self, timeout_s: float) -> None:
        """End the thread after the piece under way, or leave it after this time."""
        self._closed = True
        if self._current is not None:
            self._current.cancelled = True
        self._wake.set()
        if self._thread is not None:
            self._thread.join(timeout_s)

    def _run(self) -> None:
        while not self._closed:
            self._wake.wait()
            self._wake.clear()
            interval_s = sys.getswitchinterval()
            sys.setswitchinterval(SWITCH_INTERVAL_S)
            try:
                while self._waiting and not self._closed:
                    self._waiting.popleft().compute()
            finally:
                sys.setswitchinterval(interval_s)
