"""How often a message is sent: by the configuration, until somebody asks for it otherwise."""

from __future__ import annotations

from math import isfinite

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, NS_PER_US, HostNs

SHORTEST_NS = 20 * NS_PER_MS
"""The camera guide's own example asks for 10 microseconds and means 10 Hz: nobody gets more than 50 a second."""
LONGEST_NS = 60 * NS_PER_S
MAX_REQUESTERS = 16
UNASKED_NS = NS_PER_S // 2
"""Through the autopilot's link nothing that was not asked for goes out more than twice a second."""


class Interval:
    """One message's interval. The fastest of those who ask decides; who stops it, stops it for himself."""

    def __init__(self, default_ns: int):
        self._default_ns = default_ns
        self._asked_ns: dict[tuple[int, int], int | None] = {}

    @property
    def is_asked(self) -> bool:
        """Somebody wants it at a rate of his own."""
        return any(interval_ns is not None for interval_ns in self._asked_ns.values())

    @property
    def ns(self) -> int | None:
        """Between two messages; None: those who asked have all stopped it."""
        wanted = [interval_ns for interval_ns in self._asked_ns.values() if interval_ns is not None]
        if wanted:
            return min(wanted)
        return None if self._asked_ns else self._default_ns

    def ask(self, requester: tuple[int, int], interval_us: float) -> bool:
        """SET_MESSAGE_INTERVAL's param2: -1 stops it, and so does 0, as the camera guide has it. False: no number."""
        if not isfinite(interval_us):
            return False
        self._asked_ns.pop(requester, None)
        if len(self._asked_ns) >= MAX_REQUESTERS:
            del self._asked_ns[next(iter(self._asked_ns))]
        asked_ns = min(max(round(interval_us * NS_PER_US), SHORTEST_NS), LONGEST_NS)
        self._asked_ns[requester] = asked_ns if interval_us > 0.0 else None
        return True


class Cadence:
    """A clock that ticks at an interval which may change, and does not drift."""

    def __init__(self) -> None:
        self.next_ns: HostNs | None = None
        """None until it is started."""

    def tick(self, now: HostNs, interval_ns: int) -> bool:
        """Whether it is time; the next time is then one interval later. Starts with a tick."""
        if self.next_ns is None:
            self.next_ns = HostNs(now + interval_ns)
            return True
        if now < self.next_ns:
            self.next_ns = HostNs(min(self.next_ns, now + interval_ns))
            return False
        late = now >= self.next_ns + interval_ns
        self.next_ns = HostNs((now if late else self.next_ns) + interval_ns)
        return True
