"""What is to happen when: a heap of actions, done in order of time and then of asking."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from itertools import count

Action = Callable[[int], None]
"""Called with the instant for which it was asked, however late the caller is."""


class Agenda:
    """Pure: ``wake_at`` says when, ``run(now)`` does what is due."""

    def __init__(self) -> None:
        self._heap: list[tuple[int, int, Action]] = []
        self._order = count()

    def at(self, host_ns: int, action: Action) -> None:
        """Do it then."""
        heappush(self._heap, (host_ns, next(self._order), action))

    @property
    def wake_at(self) -> int | None:
        """The next instant at which something is due."""
        return self._heap[0][0] if self._heap else None

    def run(self, now_ns: int) -> None:
        """Everything that is due by now, including what that brings about."""
        while self._heap and self._heap[0][0] <= now_ns:
            due_ns, _, action = heappop(self._heap)
            action(due_ns)
