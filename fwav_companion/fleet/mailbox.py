"""Messages of a fleet that wait for their reader: a turn for each vehicle, and a bound on their bytes. PURE.

A vehicle that sends more than the reader takes delays no other one: vehicles are served one message each in turn, and
what is too much is dropped from the one that holds most, its oldest first. Names that the reader does not know share
one turn, because strangers can invent any number of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from fwav_companion.fair_queues import FairQueues

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
        self._queues: FairQueues[str, Waiting] = FairQueues(_size)
        """By vehicle; "": names that are not known."""
        self.dropped = 0
        """Messages that were dropped since the start."""

    def __bool__(self) -> bool:
        """Whether any message waits."""
        return bool(self._queues)

    @property
    def total_bytes(self) -> int:
        """Bytes that wait, with those of their names and of the queues."""
        return self._queues.total_bytes

    def put(self, vehicle: str, kind: str, data: bytes) -> None:
        """Add a message, and drop those for which there is no room."""
        self._queues.put(vehicle if self._is_known(vehicle) else "", (vehicle, kind, data))
        while self._queues.total_bytes > self._most_bytes:
            self._queues.drop()
            self.dropped += 1

    def take(self) -> Waiting | None:
        """Return the oldest message of the vehicle whose turn it is; None if none waits."""
        return self._queues.take()


def _size(waiting: Waiting) -> int:
    vehicle, kind, data = waiting
    return len(vehicle) + len(kind) + len(data) + OVERHEAD_BYTES
