"""Rations stations' requests for message rates: an autopilot works on each, and its answers fill the link.

A link's requests are shared out to its sources (max-min fairness): strangers that speak from many addresses use up the
link's ration, and not that of a station that was heard before them.
"""

from __future__ import annotations

from typing import Final

import msgspec

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
"""Sources remembered on a link, as many as have places. Beyond it, the newest makes room for a newcomer."""
SILENT_NS: Final = 60 * NS_PER_S
"""Silence after which a source is forgotten, as its rates are."""


class _Source(msgspec.Struct):
    """What one source may ask for now."""

    heard_ns: HostNs
    left: float = SOURCE_BURST
    """Requests that it may send at most."""
    own: int = 0
    """Of them, those that are kept for it; the others are taken from what the link has left for all."""
    turn: int = 0
    """Number of the last turn in which it was given one."""


class Ration:
    """Ration of one link, and of each source address on it; where a link has only one, of each sender.

    A source that is heard keeps a part of the link's requests for itself: those that the link earns are dealt in turn.
    """

    def __init__(self) -> None:
        self._sources: dict[str | int, _Source] = {}
        """In order of arrival."""
        self._common = LINK_BURST
        """Requests that the link has left for all."""
        self._earned = 0.0
        """Requests that were not dealt yet, less than one."""
        self._turn = 0
        self._filled_ns: HostNs | None = None

    def hear(self, source: str | int, now: HostNs) -> None:
        """Note a heartbeat. ``source``: host, or (system << 8 | component). It gets a share if there is a place."""
        self._fill(now)
        if source in self._sources:
            self._sources[source].heard_ns = now
        elif len(self._sources) < MAX_SOURCES:
            self._sources[source] = _Source(now, turn=self._turn)

    def takes(self, source: str | int, now: HostNs) -> bool:
        """Whether a request may pass now; it counts if so. ``source`` as in :meth:`hear`."""
        self._fill(now)
        asks = self._sources.get(source)
        if asks is None:
            if len(self._sources) >= MAX_SOURCES:
                self._remove(next(reversed(self._sources)))
            asks = self._sources[source] = _Source(now, turn=self._turn)
        asks.heard_ns = now
        if asks.left < 1.0 or (not asks.own and self._common < 1.0):
            return False
        asks.left -= 1.0
        if asks.own:
            asks.own -= 1
        else:
            self._common -= 1.0
        return True

    def _fill(self, now: HostNs) -> None:
        """Deal what has come since the last time: to the sources that have less than their part, then to all."""
        elapsed_s = 0.0 if self._filled_ns is None else (now - self._filled_ns) / NS_PER_S
        self._filled_ns = now
        for silent in [each for each, asks in self._sources.items() if now - asks.heard_ns > SILENT_NS]:
            self._remove(silent)
        for asks in self._sources.values():
            asks.left = min(SOURCE_BURST, asks.left + SOURCE_PER_S * elapsed_s)
        self._earned += LINK_PER_S * elapsed_s
        part = min(SOURCE_BURST, LINK_BURST // max(len(self._sources), 1))
        while self._earned >= 1.0:
            needy = [asks for asks in self._sources.values() if asks.own < part]
            if not needy:
                self._common, self._earned = min(LINK_BURST, self._common + self._earned), 0.0
                return
            asks = min(needy, key=lambda each: each.turn)
            self._turn += 1
            asks.own, asks.turn = asks.own + 1, self._turn
            self._earned -= 1.0

    def _remove(self, source: str | int) -> None:
        self._common = min(LINK_BURST, self._common + self._sources.pop(source).own)


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
