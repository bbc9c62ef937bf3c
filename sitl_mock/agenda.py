"""Event queue: a heap of actions, run in order of time, then of scheduling."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from itertools import count

Action = Callable[[int], None]
"""Action, called with the instant for which it was scheduled, however late the caller is."""


class Agenda:
    """Pure event queue: ``wake_at`` is the next due instant, ``run(now)`` runs the actions that are due."""

    def __init__(self) -> None:
        self._heap: list[tuple[int, int, Action]] = []
        self._order = count()

    def at(self, host_ns: int, action: Action) -> None:
        """Schedules an action at an instant."""
        heappush(self._heap, (host_ns, next(self._order), action))

    @property
    def wake_at(self) -> int | None:
        """Instant of the next action; None: the queue is empty."""
        return self._heap[0][0] if self._heap else None

    def run(self, now_ns: int) -> None:
        """Runs every action due by now, including those that these actions schedule."""
        while self._heap and self._heap[0][0] <= now_ns:
            due_ns, _, action = heappop(self._heap)
            action(due_ns)
