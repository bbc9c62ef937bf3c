"""Queues transfers that are faster than a link: frames keep their order and leave as the link's budget allows.

An autopilot paces a parameter list or a log by its own link to us: ArduPilot gives it 30 % of that link's bandwidth
(GCS_Param.cpp, queued_param_send), 27 kB/s at 921 600 baud. A radio behind us carries a fifth of that. No frame of a
transfer is thinned. The frames wait in this queue, not in a buffer that overflows. Each origin of frames has a queue of
its own, and they take turns: a stranger's transfer delays an autopilot's parameters by one frame each.
"""

from __future__ import annotations

from collections import deque
from typing import Final, TypeAlias

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.byte_budget import ByteBudget
from fwav_companion.mavlink.wire.definitions import BY_NAME

TRANSFERS: Final = frozenset(
    BY_NAME[name].msgid
    for name in (
        "PARAM_VALUE", "PARAM_EXT_VALUE", "LOG_ENTRY", "LOG_DATA", "LOGGING_DATA", "LOGGING_DATA_ACKED",
        "FILE_TRANSFER_PROTOCOL", "ENCAPSULATED_DATA",
    )
)  # fmt: skip
"""Ids of messages that come in sequences of hundreds."""
SHARE: Final = 0.6
"""Largest share of the budget for transfers: telemetry continues, thinned, during a transfer."""
MAX_HELD_BYTES: Final = 65_536
"""Queue limit of one link: a list of 1700 parameters of 37 bytes. Beyond it the newest frame of the origin with most is
lost, and its receiver requests it again; a transfer that stays faster than its link for longer cannot be kept whole."""
MAX_HOSTS: Final = 16
"""Hosts of one link with a queue of their own; newcomers beyond them share one, and leave that of other links alone."""
Origin: TypeAlias = tuple[int, str]
"""(number of the link, host) from which frames come."""
_OTHERS: Final = "others"


class HeldTransfers:
    """Queues of the transfer frames that wait for one link."""

    def __init__(self) -> None:
        self._queues: dict[Origin, deque[bytes]] = {}
        """Queues that are not empty, in the order of their turns."""
        self._bytes_of: dict[Origin, int] = {}
        self._bytes = 0
        self._budget = ByteBudget()

    def __bool__(self) -> bool:
        """Whether any frame waits."""
        return bool(self._queues)

    def takes(self, data: bytes, origin: Origin, bytes_per_s: float, now: HostNs) -> bool:
        """Queue a frame, or lose one if the queue is full. Returns False if the frame may leave at once."""
        self._budget.fill(SHARE * bytes_per_s, now)
        if not self._queues and self._budget.is_free:
            self._budget.spend(len(data))
            return False
        if origin not in self._queues and sum(link == origin[0] for link, _ in self._queues) >= MAX_HOSTS:
            origin = (origin[0], _OTHERS)
        self._queues.setdefault(origin, deque()).append(data)
        self._count(origin, len(data))
        while self._bytes > MAX_HELD_BYTES:
            self._remove(max(self._bytes_of, key=self._bytes_of.__getitem__), newest=True)
        return True

    def release(self, bytes_per_s: float | None, now: HostNs) -> list[bytes]:
        """Return the frames that may leave now, each origin's in order; all if there is no budget any more."""
        if bytes_per_s is not None:
            self._budget.fill(SHARE * bytes_per_s, now)
        released = []
        while self._queues and (bytes_per_s is None or self._budget.is_free):
            origin = next(iter(self._queues))
            released.append(self._remove(origin))
            if origin in self._queues:
                self._queues[origin] = self._queues.pop(origin)  # the others first
            self._budget.spend(len(released[-1]))
        return released

    def release_at(self, bytes_per_s: float | None, now: HostNs) -> HostNs:
        """Return the time at which :meth:`release` has a frame."""
        return now if bytes_per_s is None else self._budget.free_at(SHARE * bytes_per_s, now)

    def clear(self) -> None:
        """Drop the waiting frames."""
        self._queues.clear()
        self._bytes_of.clear()
        self._bytes = 0

    def _remove(self, origin: Origin, *, newest: bool = False) -> bytes:
        queue = self._queues[origin]
        data = queue.pop() if newest else queue.popleft()
        self._count(origin, -len(data))
        if not queue:
            del self._queues[origin], self._bytes_of[origin]
        return data

    def _count(self, origin: Origin, size: int) -> None:
        self._bytes_of[origin] = self._bytes_of.get(origin, 0) + size
        self._bytes += size
