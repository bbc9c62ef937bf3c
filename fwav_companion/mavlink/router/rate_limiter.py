"""Thins the messages that leave by a slow link: at most a given number a second of each stream."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Final

from fwav_companion.geometry.stamps import HostNs, ns_from_s
from fwav_companion.mavlink.wire.definitions import BY_NAME

_PAUSE: Final = 2
"""Intervals without a frame after which the grid restarts. One may be jitter of a source that is hardly faster."""
MAX_STREAMS: Final = 1024
"""Streams of (message, sender, instance) on one link; beyond it all grids restart, and each stream passes once."""


class RateLimiter:
    """Decides which messages may leave by one link now. A message without a highest rate always may."""

    def __init__(self, max_rate_hz: Mapping[str, float]) -> None:
        """Start with rates by message name; 0 lets no frame pass. Names that the dialect does not have are ignored."""
        self.max_rate_hz = {BY_NAME[name].msgid: rate for name, rate in max_rate_hz.items() if name in BY_NAME}
        """Highest rate by message id, hertz."""
        self._slots_ns: dict[tuple[int, int, int], int] = {}
        """Slot of each stream's grid that was used last, by stream: the rate may differ at the next."""

    def limits(self, msgid: int) -> bool:
        """Return whether the configuration gives the message a highest rate."""
        return msgid in self.max_rate_hz

    def passes(self, msgid: int, sender: int, instance: int, now: HostNs, *, at_most_hz: float = inf) -> bool:
        """Return whether a frame may leave, at the configured rate or at ``at_most_hz``, whichever is lower.

        Each sender, and each instance (the second battery), has a separate rate. Send times lie on a grid of whole
        intervals while frames keep arriving, so the mean rate is exact whatever the jitter; after a pause the grid
        restarts.
        """
        hz = min(at_most_hz, self.max_rate_hz.get(msgid, inf))
        if hz <= 0.0 or hz == inf:
            return hz > 0.0
        interval = ns_from_s(1.0 / hz)
        stream = (msgid, sender, instance)
        slot = self._slots_ns.get(stream)
        if slot is None and len(self._slots_ns) >= MAX_STREAMS:
            self._slots_ns.clear()
        due = now if slot is None else slot + interval
        if now < due:
            return False
        self._slots_ns[stream] = now if now - due >= _PAUSE * interval else due
        return True
