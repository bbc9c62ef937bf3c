"""Solves between their start and their take-over: who computes them, and whether they are late."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import msgspec

from fwav_companion.types.flight_status import SolveReport

if TYPE_CHECKING:
    from fwav_companion.estimation.solve import Estimate, SolveTask


class SolveJob(Protocol):
    """A solve under way."""

    def estimate(self) -> Estimate | None:
        """The estimate; None while it is being computed. An exception of the solve is raised here."""
        ...


Solver = Callable[["SolveTask"], SolveJob]
"""Starts a solve. A later start makes an unfinished earlier solve unnecessary."""


class InLineJob:
    """A solve that is computed when its estimate is asked for, once."""

    __slots__ = ("_estimate", "_task")

    def __init__(self, task: SolveTask) -> None:
        self._task = task
        self._estimate: Estimate | None = None

    def estimate(self) -> Estimate:
        """The estimate."""
        if self._estimate is None:
            self._estimate = self._task.run()
        return self._estimate


class SmootherOptions(msgspec.Struct, frozen=True):
    """How the smoother is run."""

    solver: Solver = InLineJob
    whole_flight: bool = False
    """Keep sightings for the answers by the whole flight."""


class PendingSolve(msgspec.Struct, frozen=True):
    """A solve that was started and is not yet taken over."""

    due_s: float
    """Instant of its take-over on the clock of captures."""
    job: SolveJob


class SolveCounts(msgspec.Struct):
    """Solves of a flight."""

    taken: int = 0
    """Estimates that were taken over."""
    late: int = 0
    """Solves that were not ready at their take-over and were taken over when they were."""
    failed: int = 0
    """Solves without a finite estimate: the former one stays."""
    _late_due_s: float = -1.0

    @property
    def report(self) -> SolveReport:
        """For the status."""
        return SolveReport(taken=self.taken, late=self.late, failed=self.failed)

    def miss(self, pending: PendingSolve) -> None:
        """Count a solve that is not ready, once."""
        if pending.due_s != self._late_due_s:
            self._late_due_s = pending.due_s
            self.late += 1
