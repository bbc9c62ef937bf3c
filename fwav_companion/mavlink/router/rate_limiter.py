"""Fewer messages on the way out of a slow link: at most so many a second of those that the configuration names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from fwav_companion.geometry.stamps import HostNs, ns_from_s
from fwav_companion.mavlink.wire.definitions import BY_NAME

_PAUSE: Final = 2
"""Intervals without a frame after which the grid begins anew. One may be jitter of a source that is hardly faster."""
MAX_STREAMS: Final = 1024
"""Of (message, sender, instance) on one link; when there are more, all begin anew and each passes once."""


class RateLimiter:
    """Which messages may leave by one link now. What is not named always may."""

    def __init__(self, max_rate_hz: Mapping[str, float]) -> None:
        """``max_rate_hz`` by message name; 0 lets none pass. Names that the dialect does not have limit nothing."""
        self._interval_ns = {
            BY_NAME[name].msgid: ns_from_s(1.0 / rate) if rate > 0.0 else None
            for name, rate in max_rate_hz.items()
            if name in BY_NAME
        }
        self._due_ns: dict[tuple[int, int, int], int] = {}

    def limits(self, msgid: int) -> bool:
        """The message is one of those that are thinned."""
        return msgid in self._interval_ns

    def passes(self, msgid: int, sender: int, instance: int, now: HostNs) -> bool:
        """Each sender, and each instance (the second battery), has the rate for itself.

        Instants lie on a grid of whole intervals as long as frames keep coming, so the mean rate is kept exactly
        whatever the jitter; after a pause the grid begins anew.
        """
        if msgid not in self._interval_ns:
            return True
        interval = self._interval_ns[msgid]
        if interval is None:
            return False
        stream = (msgid, sender, instance)
        due = self._due_ns.get(stream)
        if due is None and len(self._due_ns) >= MAX_STREAMS:
            self._due_ns.clear()
        if due is None or now - due >= _PAUSE * interval:
            due = now
        elif now < due:
            return False
        self._due_ns[stream] = due + interval
        return True
