"""Intervals of messages: as configured, until a station requests another. Pure."""

from __future__ import annotations

from collections.abc import Collection
from math import isfinite
from typing import TypeAlias

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, NS_PER_US, HostNs

SHORTEST_NS = 20 * NS_PER_MS
"""Shortest interval, 50 Hz: the camera guide's own example requests 10 microseconds and means 10 Hz."""
LONGEST_NS = 60 * NS_PER_S
MAX_STATIONS = 16
FORGOTTEN_NS = 60 * NS_PER_S
"""Silence after which a station's requests end, as those for the autopilot's messages."""
YIELDS_NS = 10 * NS_PER_S
"""Silence after which a station yields its place to a new one: ten missed heartbeats."""
UNASKED_NS = NS_PER_S // 2
"""Shortest interval on the autopilot's link of a message that no station requested: twice a second."""

Station: TypeAlias = tuple[int, int]
"""(system, component)."""


class Stations:
    """Ground stations and other requesters that are heard."""

    def __init__(self) -> None:
        self._heard_ns: dict[Station, HostNs] = {}

    def __contains__(self, station: Station) -> bool:
        """Whether a station is heard."""
        return station in self._heard_ns

    def hear(self, station: Station, now: HostNs) -> bool:
        """Note a heartbeat or request. Returns False if there is no place: who is heard keeps its own."""
        if station not in self._heard_ns and len(self._heard_ns) >= MAX_STATIONS:
            silent = min(self._heard_ns, key=self._heard_ns.__getitem__)
            if now - self._heard_ns[silent] < YIELDS_NS:
                return False
            del self._heard_ns[silent]
        self._heard_ns[station] = now
        return True

    def expire(self, now: HostNs) -> None:
        """Forget the silent ones."""
        for station in [each for each, heard_ns in self._heard_ns.items() if now - heard_ns > FORGOTTEN_NS]:
            del self._heard_ns[station]

    def has_others(self, than: Collection[Station]) -> bool:
        """Whether there are, or may be, stations besides these: a full table does not list all."""
        return len(self._heard_ns) >= MAX_STATIONS or any(station not in than for station in self._heard_ns)


class Interval:
    """Interval of one message: the shortest one that a station wants.

    A station without a request wants the default, and a stop ends the message only where every station has stopped it:
    a stranger does not take it from the others.
    """

    def __init__(self, default_ns: int):
        self._default_ns = default_ns
        self._asked_ns: dict[Station, int | None] = {}
        self._at_default: set[Station] = set()
        self.ns: int | None = default_ns
        """Time between two messages, nanoseconds; None where every station has stopped the message."""

    @property
    def is_asked(self) -> bool:
        """Whether a station requested an interval."""
        return any(
            interval_ns is not None and requester not in self._at_default
            for requester, interval_ns in self._asked_ns.items()
        )

    def ask(self, requester: Station, interval_us: float) -> bool:
        """Take param2 of SET_MESSAGE_INTERVAL: microseconds, 0 for the default interval, -1 to stop.

        Returns False where param2 is not a finite number. It counts from :meth:`refresh` on.
        """
        if not isfinite(interval_us):
            return False
        self._at_default.discard(requester)
        if interval_us == 0.0:
            self._at_default.add(requester)
            self._asked_ns[requester] = self._default_ns
        else:
            asked_ns = min(max(round(interval_us * NS_PER_US), SHORTEST_NS), LONGEST_NS)
            self._asked_ns[requester] = asked_ns if interval_us > 0.0 else None
        return True

    def refresh(self, stations: Stations) -> None:
        """Compute the interval by the stations that are heard; the requests of others end."""
        for requester in [each for each in self._asked_ns if each not in stations]:
            del self._asked_ns[requester]
            self._at_default.discard(requester)
        wanted = [interval_ns for interval_ns in self._asked_ns.values() if interval_ns is not None]
        if not self._asked_ns or stations.has_others(self._asked_ns):
            wanted.append(self._default_ns)
        self.ns = min(wanted, default=None)


class Cadence:
    """Due instants of a message at an interval that may change, without drift."""

    def __init__(self) -> None:
        self.next_ns: HostNs | None = None
        """The next instant; None until the first call of :meth:`tick`."""

    def tick(self, now: HostNs, interval_ns: int) -> bool:
        """Whether the message is due; if so, the next instant is one interval later. At the first call it is due."""
        if self.next_ns is None:
            self.next_ns = HostNs(now + interval_ns)
            return True
        if now < self.next_ns:
            self.next_ns = HostNs(min(self.next_ns, now + interval_ns))
            return False
        late = now >= self.next_ns + interval_ns
        self.next_ns = HostNs((now if late else self.next_ns) + interval_ns)
        return True
