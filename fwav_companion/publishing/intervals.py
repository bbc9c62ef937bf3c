"""Intervals of messages: as configured, until a station requests another. Pure."""

from __future__ import annotations

from math import isfinite

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, NS_PER_US, HostNs

SHORTEST_NS = 20 * NS_PER_MS
"""Shortest interval, 50 Hz: the camera guide's own example requests 10 microseconds and means 10 Hz."""
LONGEST_NS = 60 * NS_PER_S
MAX_REQUESTERS = 16
UNASKED_NS = NS_PER_S // 2
"""Shortest interval on the autopilot's link of a message that no station requested: twice a second."""


class Interval:
    """Interval of one message: the shortest one requested. A station's request to stop ends only its own request."""

    def __init__(self, default_ns: int):
        self._default_ns = default_ns
        self._asked_ns: dict[tuple[int, int], int | None] = {}
        self._at_default: set[tuple[int, int]] = set()

    @property
    def is_asked(self) -> bool:
        """Whether a station requested an interval."""
        return any(
            interval_ns is not None and requester not in self._at_default
            for requester, interval_ns in self._asked_ns.items()
        )

    @property
    def ns(self) -> int | None:
        """Time between two messages, nanoseconds; None where every station with a request has stopped the message."""
        wanted = [interval_ns for interval_ns in self._asked_ns.values() if interval_ns is not None]
        if wanted:
            return min(wanted)
        return None if self._asked_ns else self._default_ns

    def ask(self, requester: tuple[int, int], interval_us: float) -> bool:
        """Take param2 of SET_MESSAGE_INTERVAL: microseconds, 0 for the default interval, -1 to stop.

        Returns False where param2 is not a finite number.
        """
        if not isfinite(interval_us):
            return False
        self._forget(requester)
        if len(self._asked_ns) >= MAX_REQUESTERS:
            self._forget(next(iter(self._asked_ns)))
        if interval_us == 0.0:
            self._at_default.add(requester)
            self._asked_ns[requester] = self._default_ns
        else:
            asked_ns = min(max(round(interval_us * NS_PER_US), SHORTEST_NS), LONGEST_NS)
            self._asked_ns[requester] = asked_ns if interval_us > 0.0 else None
        return True

    def _forget(self, requester: tuple[int, int]) -> None:
        self._asked_ns.pop(requester, None)
        self._at_default.discard(requester)


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
