"""Rations stations' requests for message rates: an autopilot works on each, and its answers fill the link."""

from __future__ import annotations

from typing import Final

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire.enums import MAV_RESULT_TEMPORARILY_REJECTED
from fwav_companion.mavlink.wire.rate_messages import RateRequest
from fwav_companion.types import Destination, Outgoing

SOURCE_PER_S: Final = 2.0
SOURCE_BURST: Final = 40.0
"""Requests at once: a station's first requests are one for each of some thirty messages."""
LINK_PER_S: Final = 6.0
LINK_BURST: Final = 120.0
"""Three stations that start at once, as their rates together."""
MAX_SOURCES: Final = 16
"""Sources remembered on a link; beyond it, the one with the fullest bucket is forgotten, which loses the least."""


class _Bucket:
    """Token bucket: a rate a second, and a burst."""

    __slots__ = ("_burst", "_per_s", "_since_ns", "left")

    def __init__(self, per_s: float, burst: float, now: HostNs) -> None:
        self._per_s, self._burst, self._since_ns = per_s, burst, now
        self.left = burst

    def fill(self, now: HostNs) -> float:
        """Return the number of requests that may pass now."""
        self.left = min(self._burst, self.left + self._per_s * (now - self._since_ns) / NS_PER_S)
        self._since_ns = now
        return self.left


class Ration:
    """Ration of one link, and of each source address on it; where a link has only one, of each sender."""

    def __init__(self) -> None:
        self._link: _Bucket | None = None
        self._sources: dict[str | int, _Bucket] = {}

    def takes(self, source: str | int, now: HostNs) -> bool:
        """Whether a request may pass now; it counts if so. ``source``: host, or (system << 8 | component)."""
        if self._link is None:
            self._link = _Bucket(LINK_PER_S, LINK_BURST, now)
        bucket = self._sources.get(source)
        if bucket is None:
            if len(self._sources) >= MAX_SOURCES:
                del self._sources[max(self._sources, key=lambda one: self._sources[one].fill(now))]
            bucket = self._sources[source] = _Bucket(SOURCE_PER_S, SOURCE_BURST, now)
        if bucket.fill(now) < 1.0 or self._link.fill(now) < 1.0:
            return False
        bucket.left -= 1.0
        self._link.left -= 1.0
        return True


def rejection(request: RateRequest, component: int) -> Outgoing | None:
    """Return the answer of our ``component`` to a request beyond the ration; None for one by message, which has no
    answer.
    """
    if request.command is None:
        return None
    fields = {
        "command": request.command,
        "result": MAV_RESULT_TEMPORARILY_REJECTED,
        "progress": 0,
        "result_param2": 0,
        "target_system": request.system,
        "target_component": request.component,
    }
    return Outgoing(name="COMMAND_ACK", fields=fields, to=Destination.REPLY, component=component, link=request.link)
