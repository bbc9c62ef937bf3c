"""Two questions about one message: which rate will the autopilot take, and at which rate does it come?"""

from __future__ import annotations

from math import sqrt

from fwav_companion.geometry.stamps import NS_PER_S, HostNs

SLOWEST_US = 1_000_000
"""Refused at this interval, or at the wanted one if that is longer still: the autopilot does not send the message."""
STEP_US = 1000
"""Autopilots keep intervals in whole milliseconds."""
CLOSE_ENOUGH = 1.02
"""Between the fastest interval that was accepted and the slowest that was refused, where it is more than a step."""
MIN_WINDOW_S = 2.0
MAX_WINDOW_S = 30.0
ARRIVALS_PER_WINDOW = 8.0


class RateSearch:
    """The shortest accepted interval that is not shorter than the wanted one.

    First the wanted interval; if it is refused, the slowest, to tell a rate that is too high from a message that the
    autopilot does not know; then between them by halves on a logarithmic scale. An autopilot with a ceiling of its
    scheduler's rate (ArduPilot: 0.8 of the main loop) is so found out within about ten questions.
    """

    __slots__ = ("_refused_us", "_slowest_us", "_wanted_us", "accepted_us", "asking_us", "denied")

    def __init__(self, wanted_hz: float):
        self._wanted_us = max(1, round(1e6 / wanted_hz))
        self._slowest_us = max(SLOWEST_US, self._wanted_us)
        self.restart()

    def restart(self) -> None:
        """Nothing is known about what the autopilot accepts."""
        self._refused_us = 0
        self.accepted_us: int | None = None
        """The shortest interval that was accepted."""
        self.asking_us: int | None = self._wanted_us
        """The interval to ask for next; None: there is nothing left to find out."""
        self.denied = False
        """Refused at every interval."""

    def on_accepted(self) -> None:
        """The interval that was asked for is taken."""
        if self.asking_us is None:
            return
        self.accepted_us = self.asking_us
        self.asking_us = self._between(self.accepted_us)

    def on_refused(self) -> None:
        """It is not."""
        if self.asking_us is None:
            return
        self._refused_us = max(self._refused_us, self.asking_us)
        if self.accepted_us is not None:
            # The last accepted interval should still stand; asking for it once more makes it certain.
            self.asking_us = self._between(self.accepted_us) or self.accepted_us
        elif self.asking_us < self._slowest_us:
            self.asking_us = self._slowest_us
        else:
            self.asking_us, self.denied = None, True

    def _between(self, accepted_us: int) -> int | None:
        """An interval between what was refused and what was accepted; None where they are next to each other."""
        refused_us = self._refused_us
        if refused_us == 0 or accepted_us <= max(refused_us + STEP_US, refused_us * CLOSE_ENOUGH):
            return None
        middle_us = round(sqrt(refused_us * accepted_us) / STEP_US) * STEP_US
        return min(max(middle_us, refused_us + 1), accepted_us - 1)


class ArrivalMeter:
    """Arrivals a second, over windows long enough for eight of them."""

    __slots__ = ("_count", "_since_ns", "hz")

    def __init__(self) -> None:
        self._count = 0
        self._since_ns: HostNs | None = None
        self.hz: float | None = None
        """Of the last full window; None before there was one."""

    def restart(self, now: HostNs) -> None:
        """Begin a window: what came before was sent under another agreement."""
        self._count, self._since_ns = 0, now

    def forget(self, now: HostNs) -> None:
        """Begin a window as if there had been none."""
        self._count, self._since_ns, self.hz = 0, now, None

    def arrived(self) -> None:
        """One message came."""
        self._count += 1

    def roll(self, now: HostNs, expected_hz: float) -> bool:
        """End the window if it is long enough. True: :attr:`hz` is new."""
        if self._since_ns is None:
            self._since_ns = now
        window_s = min(max(MIN_WINDOW_S, ARRIVALS_PER_WINDOW / expected_hz), MAX_WINDOW_S)
        elapsed_ns = now - self._since_ns
        if elapsed_ns < window_s * NS_PER_S:
            return False
        self.hz = self._count * NS_PER_S / elapsed_ns
        self._count, self._since_ns = 0, now
        return True
