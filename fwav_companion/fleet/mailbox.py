"""Messages of a fleet that wait for their reader: a turn for each vehicle, and a bound on their bytes. Pure.

A vehicle that sends more than the reader takes delays no other one: vehicles are served one message each in turn, and
what is too much is dropped from the one that holds most, its oldest first. Names that the reader does not know share
one turn, because strangers can invent any number of them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final

MOST_BYTES: Final = 16_000_000
"""Most bytes that wait: a second of 200 vehicles with 256 tracks each at 2 Hz."""
OVERHEAD_BYTES: Final = 400
"""Memory of a message besides its bytes: the entry of the queue, and the objects in it."""

Waiting = tuple[str, str, bytes]
"""(vehicle, kind, payload)."""


class Mailbox:
    """Queues by vehicle."""

    def __init__(self, is_known: Callable[[str], bool], most_bytes: int = MOST_BYTES) -> None:
        """``is_known``: whether a vehicle has a place at the reader, which bounds the number of queues."""
        self._is_known, self._most_bytes = is_known, most_bytes
        self._queues: dict[str, deque[Waiting]] = {}
        """The vehicle whose turn is next first; "": names that are not known."""
        self._bytes: dict[str, int] = {}
        self.bytes = 0
        """Bytes that wait, with those of their names and of the queues."""
        self.dropped = 0
        """Messages that were dropped since the start."""

    def __bool__(self) -> bool:
        """Whether any message waits."""
        return bool(self._queues)

    def put(self, vehicle: str, kind: str, data: bytes) -> None:
        """Add a message, and drop those for which there is no room."""
        owner = vehicle if self._is_known(vehicle) else ""
        self._queues.setdefault(owner, deque()).append((vehicle, kind, data))
        self._count(owner, _size((vehicle, kind, data)))
        while self.bytes > self._most_bytes:
            self._take(max(self._bytes, key=self._bytes.__getitem__))
            self.dropped += 1

    def take(self) -> Waiting | None:
        """Return the oldest message of the vehicle whose turn it is; None if none waits."""
        owner = next(iter(self._queues), None)
        if owner is None:
            return None
        taken = self._take(owner)
        if owner in self._queues:
            self._queues[owner] = self._queues.pop(owner)  # the others first
        return taken

    def _take(self, owner: str) -> Waiting:
        queue = self._queues[owner]
        taken = queue.popleft()
        self._count(owner, -_size(taken))
        if not queue:
            del self._queues[owner], self._bytes[owner]
        return taken

    def _count(self, owner: str, size: int) -> None:
        self._bytes[owner] = self._bytes.get(owner, 0) + size
        self.bytes += size


def _size(waiting: Waiting) -> int:
    vehicle, kind, data = waiting
    return len(vehicle) + len(kind) + len(data) + OVERHEAD_BYTES
