"""Searches the highest rate that the autopilot accepts for one message, and measures the rate at which it arrives."""

from __future__ import annotations

from math import sqrt

from fwav_companion.geometry.stamps import NS_PER_S, HostNs

SLOWEST_US = 1_000_000
"""Slowest interval tried: if it, or a longer wanted one, is refused, the autopilot does not send the message."""
STEP_US = 1000
"""Resolution of intervals: autopilots keep them in whole milliseconds."""
CLOSE_ENOUGH = 1.02
"""Ratio of the fastest accepted interval to the slowest refused one at which the search ends, if above one step."""
MIN_WINDOW_S = 2.0
MAX_WINDOW_S = 30.0
ARRIVALS_PER_WINDOW = 8.0


class RateSearch:
    """Searches the shortest accepted interval that is not shorter than the wanted one.

    First it tries the wanted interval. If that is refused it tries the slowest, to distinguish a rate that is too high
    from a message that the autopilot does not know. Then it bisects between them on a logarithmic scale. This finds the
    ceiling of an autopilot's scheduler (ArduPilot: 0.8 of the main loop rate) within about ten requests.
    """

    __slots__ = ("_refused_us", "_slowest_us", "_wanted_us", "accepted_us", "asking_us", "denied")

    def __init__(self, wanted_hz: float):
        self._wanted_us = max(1, round(1e6 / wanted_hz))
        self._slowest_us = max(SLOWEST_US, self._wanted_us)
        self.restart()

    def restart(self) -> None:
        """Start over: no accepted or refused interval is known."""
        self._refused_us = 0
        self.accepted_us: int | None = None
        """Shortest accepted interval, microseconds."""
        self.asking_us: int | None = self._wanted_us
        """Interval to request next, microseconds; None: the search is over."""
        self.denied = False
        """Whether every interval was refused."""

    def on_accepted(self) -> None:
        """Note that the requested interval was accepted."""
        if self.asking_us is None:
            return
        self.accepted_us = self.asking_us
        self.asking_us = self._between(self.accepted_us)

    def on_refused(self) -> None:
        """Note that the requested interval was refused."""
        if self.asking_us is None:
            return
        self._refused_us = max(self._refused_us, self.asking_us)
        if self.accepted_us is not None:
            # The last accepted interval should still hold; requesting it once more makes it certain.
            self.asking_us = self._between(self.accepted_us) or self.accepted_us
        elif self.asking_us < self._slowest_us:
            self.asking_us = self._slowest_us
        else:
            self.asking_us, self.denied = None, True

    def _between(self, accepted_us: int) -> int | None:
        """Return an interval between the refused and the accepted one; None if they are adjacent."""
        refused_us = self._refused_us
        if refused_us == 0 or accepted_us <= max(refused_us + STEP_US, refused_us * CLOSE_ENOUGH):
            return None
        middle_us = round(sqrt(refused_us * accepted_us) / STEP_US) * STEP_US
        return min(max(middle_us, refused_us + 1), accepted_us - 1)


class ArrivalMeter:
    """Measures arrivals a second, over windows long enough for eight of them."""

    __slots__ = ("_count", "_since_ns", "hz")

    def __init__(self) -> None:
        self._count = 0
        self._since_ns: HostNs | None = None
        self.hz: float | None = None
        """Rate in the last full window, hertz; None before there was one."""

    def restart(self, now: HostNs) -> None:
        """Begin a window: earlier arrivals were sent at another agreed rate."""
        self._count, self._since_ns = 0, now

    def forget(self, now: HostNs) -> None:
        """Begin a window and drop the measured rate."""
        self._count, self._since_ns, self.hz = 0, now, None

    def arrived(self) -> None:
        """Count one message."""
        self._count += 1

    def roll(self, now: HostNs, expected_hz: float) -> bool:
        """End the window if it is long enough. Returns True if :attr:`hz` is new."""
        if self._since_ns is None:
            self._since_ns = now
        window_s = min(max(MIN_WINDOW_S, ARRIVALS_PER_WINDOW / expected_hz), MAX_WINDOW_S)
        elapsed_ns = now - self._since_ns
        if elapsed_ns < window_s * NS_PER_S:
            return False
        self.hz = self._count * NS_PER_S / elapsed_ns
        self._count, self._since_ns = 0, now
        return True
