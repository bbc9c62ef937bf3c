"""One line of a benchmark: a ratio from an interleaved run on one machine, and what it should be."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import NamedTuple


class Figure(NamedTuple):
    name: str
    ratio: float
    budget: float
    at_least: bool
    """The budget is a minimum (a speed-up), else a maximum."""
    detail: str

    @property
    def ok(self) -> bool:
        return self.ratio >= self.budget if self.at_least else self.ratio <= self.budget

    def __str__(self) -> str:
        bound = "at least" if self.at_least else "at most"
        return f"{self.name}: {self.ratio:.2f} ({bound} {self.budget}) {'ok' if self.ok else 'MISSED'}; {self.detail}"


def interleaved(*works: Callable[[], object], rounds: int = 9) -> list[float]:
    """CPU seconds of each work, the median of rounds in which all take turns, so that a slow moment slows them all."""
    times: list[list[float]] = [[] for _ in works]
    for _ in range(rounds):
        for work, spent in zip(works, times, strict=True):
            start = time.process_time()
            work()
            spent.append(time.process_time() - start)
    return [median(spent) for spent in times]
