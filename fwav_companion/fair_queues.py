"""Queues that take turns, one for each sender: a flood of one delays another by one item each, and loses its own. PURE.

Frames wait in them for a slow line (``links``) or a radio's budget (``mavlink``), a fleet's messages for their reader.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final, Generic, TypeAlias, TypeVar

Owner = TypeVar("Owner")
Item = TypeVar("Item")
Origin: TypeAlias = tuple[str, str]
"""(link, host) from which frames came; the host is "" where the link has only one peer."""
MOST_HOSTS: Final = 16
"""Hosts of one link with a queue of their own: more than a vehicle has stations. Beyond it, newcomers of the link share
one: strangers with any number of addresses take no turn of another link, such as the autopilot's."""
OTHERS: Final = "others"


class FairQueues(Generic[Owner, Item]):
    """Queues by owner. The owners are served one item each in turn."""

    def __init__(self, size_of: Callable[[Item], int]) -> None:
        """``size_of``: bytes of an item."""
        self._size_of = size_of
        self.total_bytes = 0
        """Bytes of all items."""
        self._queues: dict[Owner, deque[Item]] = {}
        """Queues that are not empty, in the order of their turns."""
        self._bytes_of: dict[Owner, int] = {}

    def __bool__(self) -> bool:
        """Whether any item waits."""
        return bool(self._queues)

    def put(self, owner: Owner, item: Item) -> None:
        """Add an item behind the others of its owner."""
        self._queues.setdefault(owner, deque()).append(item)
        self._count(owner, self._size_of(item))

    def take(self) -> Item | None:
        """Remove and return the oldest item of the owner whose turn it is; None if none waits."""
        owner = next(iter(self._queues), None)
        if owner is None:
            return None
        item = self._remove(owner)
        if owner in self._queues:
            self._queues[owner] = self._queues.pop(owner)  # the others first
        return item

    def drop(self, *, newest: bool = False) -> None:
        """Remove an item of the owner with most bytes, its oldest if not its newest. ValueError if none waits."""
        self._remove(max(self._bytes_of, key=self._bytes_of.__getitem__), newest=newest)

    def clear(self) -> None:
        """Remove all items."""
        self._queues.clear()
        self._bytes_of.clear()
        self.total_bytes = 0

    def _remove(self, owner: Owner, *, newest: bool = False) -> Item:
        queue = self._queues[owner]
        item = queue.pop() if newest else queue.popleft()
        self._count(owner, -self._size_of(item))
        if not queue:
            del self._queues[owner], self._bytes_of[owner]
        return item

    def _count(self, owner: Owner, size: int) -> None:
        self._bytes_of[owner] = self._bytes_of.get(owner, 0) + size
        self.total_bytes += size


class FrameQueues(FairQueues[Origin, bytes]):
    """Queues of frames by origin, in a bounded number for each link."""

    def __init__(self) -> None:
        super().__init__(len)

    def put(self, owner: Origin, item: bytes) -> None:
        """Add a frame; beyond MOST_HOSTS of its link to the queue that newcomers share."""
        if owner not in self._queues and sum(link == owner[0] for link, _ in self._queues) >= MOST_HOSTS:
            owner = (owner[0], OTHERS)
        super().put(owner, item)
