"""Queues transfers that are faster than a link: frames keep their order and leave as the link's budget allows.

An autopilot paces a parameter list or a log by its own link to us: ArduPilot gives it 30 % of that link's bandwidth
(GCS_Param.cpp, queued_param_send), 27 kB/s at 921 600 baud. A radio behind us carries a fifth of that. No frame of a
transfer is thinned. The frames wait in this queue, not in a buffer that overflows. Each origin of frames has a queue of
its own, and they take turns: a stranger's transfer delays an autopilot's parameters by one frame each.
"""

from __future__ import annotations

from typing import Final

from fwav_companion.fair_queues import FrameQueues, Origin
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


class HeldTransfers:
    """Queues of the transfer frames that wait for one link."""

    def __init__(self) -> None:
        self._queues = FrameQueues()
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
        self._queues.put(origin, data)
        while self._queues.total_bytes > MAX_HELD_BYTES:
            self._queues.drop(newest=True)
        return True

    def release(self, bytes_per_s: float | None, now: HostNs) -> list[bytes]:
        """Return the frames that may leave now, each origin's in order; all if there is no budget any more."""
        if bytes_per_s is not None:
            self._budget.fill(SHARE * bytes_per_s, now)
        released = []
        while (bytes_per_s is None or self._budget.is_free) and (data := self._queues.take()) is not None:
            released.append(data)
            self._budget.spend(len(data))
        return released

    def release_at(self, bytes_per_s: float | None, now: HostNs) -> HostNs:
        """Return the time at which :meth:`release` has a frame."""
        return now if bytes_per_s is None else self._budget.free_at(SHARE * bytes_per_s, now)

    def clear(self) -> None:
        """Drop the waiting frames."""
        self._queues.clear()
