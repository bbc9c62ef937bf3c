"""One TIMESYNC exchange, and the interval that contains the offset for any delays."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.types import ClockExchange

ROUNDING_NS = 2_000
"""Rounding of the three readings of an exchange."""


class Exchange(msgspec.Struct, frozen=True, gc=False):
    """One TIMESYNC exchange as offset and round trip, the form that the fits use."""

    host_ns: HostNs
    """Middle between sending and receiving."""
    offset_ns: int
    """host_from_autopilot at that instant, nanoseconds."""
    round_trip_ns: int


def exchange_from(answered: ClockExchange) -> Exchange | None:
    """The exchange as offset and round trip; None if it was received before it was sent."""
    if answered.received_ns < answered.sent_ns:
        return None
    middle_ns = HostNs((answered.sent_ns + answered.received_ns) // 2)
    return Exchange(middle_ns, middle_ns - answered.autopilot_ns, answered.received_ns - answered.sent_ns)


class HardBound:
    """Interval that contains the offset for any delays: the intersection of the exchanges' intervals, each widened by
    600 ppm of its age.

    All intervals widen at one rate, so the tightest low end is a running maximum, the tightest high end a running
    minimum.
    """

    __slots__ = ("_first_ns", "_high_ns", "_low_ns")

    def __init__(self) -> None:
        self._first_ns: HostNs | None = None
        self._low_ns = self._high_ns = 0

    def take(self, entry: Exchange) -> None:
        """Narrow the interval by one exchange."""
        low_ns = entry.offset_ns - entry.round_trip_ns // 2 - ROUNDING_NS
        high_ns = entry.offset_ns + entry.round_trip_ns // 2 + ROUNDING_NS
        if self._first_ns is None:
            self._first_ns, self._low_ns, self._high_ns = entry.host_ns, low_ns, high_ns
            return
        widening_ns = self._widening(entry.host_ns)
        self._low_ns = max(self._low_ns, low_ns + widening_ns)
        self._high_ns = min(self._high_ns, high_ns - widening_ns)

    def interval(self, now: HostNs) -> tuple[int, int]:
        """(low, high) of the offset at ``now``, not before the latest exchange; nanoseconds."""
        widening_ns = self._widening(now)
        return (self._low_ns - widening_ns, self._high_ns + widening_ns)

    def contradicts(self, entry: Exchange) -> bool:
        """Whether drift within 600 ppm cannot reconcile this exchange with those before it."""
        if self._first_ns is None:
            return False
        low_ns, high_ns = self.interval(entry.host_ns)
        half_ns = entry.round_trip_ns // 2 + ROUNDING_NS
        return entry.offset_ns + half_ns < low_ns or entry.offset_ns - half_ns > high_ns

    def _widening(self, now: HostNs) -> int:
        assert self._first_ns is not None  # noqa: S101  (callers asked)
        # 600.4 ppm: a clock that runs 600 ppm fast by its own seconds moves by 600.36 of the host's.
        return (now - self._first_ns) * 6004 // 10_000_000
