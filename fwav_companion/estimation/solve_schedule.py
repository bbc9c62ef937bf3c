"""When to solve, to search the delay and to compare kernels of the wander."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

# Gaps between solves by the time since the first one, both s: longer ones cost up to 15 % of some kinds' accuracy.
_SOLVE_GAPS = ((0.0, 1.0), (20.0, 2.0), (40.0, 4.0))
_LEAST_GAP_S = 0.999
_KERNELS_FROM_S, _KERNEL_GAPS_S, _EARLY_S = 3.0, (3.0, 10.0), 15.0
_EARLY_SEARCHES, _SECOND_SEARCH_S = 2, 3.0
_SEARCH_GAP_S = 10.0  # a search after the first ones is due where the solve is doubtful
_NEVER_S = float("-inf")


class SolveParts(NamedTuple):
    """What one solve does beside its iterations."""

    search: bool  # of the delay
    compare_kernels: bool


class SolveSchedule:
    """Instants of the next solve, search and comparison, s."""

    def __init__(self) -> None:
        self._first: float | None = None
        self._last = self._next = self._next_kernels = self._next_search = _NEVER_S
        self._searches = 0

    def is_due(self, now: float) -> bool:
        """Whether the next solve is due."""
        return now >= self._next - 1e-9

    def may_be_early(self, now: float) -> bool:
        """Whether the last solve is long enough ago for one out of turn."""
        return now >= self._last + _LEAST_GAP_S

    def start(self, now: float, *, first: bool, wanders: bool, is_doubtful: Callable[[], bool]) -> SolveParts:
        """Count a solve at `now`.

        first: nothing is known yet. wanders: whether there are kernels to compare. is_doubtful: whether the last solve
        refuses many sightings, contradicts the configuration, or has a rival.
        """
        if self._first is None:
            self._first = now
        since = now - self._first
        # The first search sees few sightings; one more when they are some seconds apart, later only when needed.
        early = self._searches < _EARLY_SEARCHES and since >= _SECOND_SEARCH_S
        search = first or early or (now >= self._next_search and is_doubtful())
        if search:
            self._next_search, self._searches = now + _SEARCH_GAP_S, self._searches + 1
        compare = wanders and since >= _KERNELS_FROM_S and now >= self._next_kernels
        if compare:
            self._next_kernels = now + _KERNEL_GAPS_S[0 if since < _EARLY_S else 1]
        self._last, self._next = now, now + [gap for start, gap in _SOLVE_GAPS if since >= start][-1]
        return SolveParts(search, compare)
