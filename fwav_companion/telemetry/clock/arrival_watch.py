"""Watches the map between exchanges by each message's arrival: a pause, a step or a new rate shows within messages.

A message that waited in a queue looks like one of a clock that paused. The watch therefore compares the least delay of
a few messages with the delays that the link had before, and it asks for exchanges, which decide.
"""

from __future__ import annotations

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.clock.clock_line import ClockLine

ARRIVALS = 5
"""Number of arrivals whose least delay is compared: four of them may be late by chance."""
LATE_NS, EARLY_NS = 12_000_000, 2_000_000
"""Least departure of the least delay that counts: later, and earlier than the stamp, which no delay explains."""
SPREADS = 4
"""Departure in mean absolute deviations of the least delay that counts too: a radio's delays vary by themselves."""
MEMORY = 16
"""Number of windows over which the usual least delay and its deviation are averaged."""
FIRST_SPREAD_NS = 3_000_000
QUIET_GAPS, GAP_MEMORY = 2, 64
"""Silence, in largest gaps, that a pause may explain, and number of arrivals over which the largest gap fades."""


class ArrivalWatch:
    """Departure of the newest arrivals from the line in use."""

    __slots__ = ("_gap_ns", "_spread_ns", "_usual_ns", "_window", "agreed_ns", "departure_s", "heard_ns", "least_ns")

    def __init__(self) -> None:
        self._window: list[int] = []
        self._usual_ns: int | None = None
        self._spread_ns = FIRST_SPREAD_NS
        self._gap_ns = 0
        self.heard_ns: HostNs | None = None
        """Newest arrival."""
        self.agreed_ns: HostNs | None = None
        """Last window of arrivals that agreed with the line."""
        self.least_ns: int | None = None
        """Least delay since :meth:`restart`, nanoseconds."""
        self.departure_s = 0.0
        """By how much the newest arrivals contradict the line, seconds; 0 where they agree."""

    def restart(self) -> None:
        """Forget the delays, because the line has changed its segment."""
        self._window.clear()
        self._usual_ns, self._spread_ns, self.least_ns, self.departure_s = None, FIRST_SPREAD_NS, None, 0.0

    def forgive(self) -> None:
        """Take the newest delays as usual, because an exchange has agreed with the line: a queue has grown."""
        self._window.clear()
        self._usual_ns, self._spread_ns, self.departure_s = None, max(self._spread_ns, FIRST_SPREAD_NS), 0.0

    def insert(self, stamp_ns: BootNs, arrival_ns: HostNs, line: ClockLine | None) -> bool:
        """Take an arrival. Returns whether a contradiction has just begun."""
        heard_ns = self.heard_ns
        if heard_ns is not None:
            gap_ns = arrival_ns - heard_ns
            faded_ns = self._gap_ns - self._gap_ns // GAP_MEMORY
            self._gap_ns = max(faded_ns, gap_ns)
        self.heard_ns = arrival_ns
        if line is None:
            return False
        window = self._window
        window.append(arrival_ns - stamp_ns - line.offset_ns - round(line.skew * (arrival_ns - line.ref_host_ns)))
        if len(window) < ARRIVALS:
            return False
        return self._judge(line, arrival_ns)

    def quiet_s(self, host_ns: HostNs, exchanged_ns: HostNs | None) -> float:
        """Time for which a paused clock would explain the silence before ``host_ns``, seconds."""
        if self.heard_ns is None or self._gap_ns == 0:
            return 0.0
        last_ns = self.heard_ns if exchanged_ns is None else max(self.heard_ns, exchanged_ns)
        return max(0, host_ns - last_ns - QUIET_GAPS * self._gap_ns) * 1e-9

    def _judge(self, line: ClockLine, arrival_ns: HostNs) -> bool:
        least_ns, most_ns = min(self._window), max(self._window)
        self._window.clear()
        usual_ns = least_ns if self._usual_ns is None else self._usual_ns
        room_ns = round(4e9 * line.scatter(arrival_ns) ** 0.5) + SPREADS * self._spread_ns
        was = self.departure_s
        if least_ns > usual_ns + room_ns + LATE_NS:
            self.departure_s = (least_ns - usual_ns) * 1e-9
        elif most_ns < -room_ns - EARLY_NS:
            self.departure_s = -most_ns * 1e-9
        else:
            self.departure_s, self.agreed_ns = 0.0, arrival_ns
            self._usual_ns = usual_ns + (least_ns - usual_ns) // MEMORY
            self._spread_ns += (abs(least_ns - usual_ns) - self._spread_ns) // MEMORY
            self.least_ns = least_ns if self.least_ns is None else min(self.least_ns, least_ns)
        return was == 0.0 and self.departure_s > 0.0
