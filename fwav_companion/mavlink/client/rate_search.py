"""Measures the rates of messages, searches the highest that the autopilot accepts, and finds who changed one."""

from __future__ import annotations

from collections import Counter
from math import sqrt

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.client.subscriptions import MESSAGE_IDS
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Message
from fwav_companion.types.situation import Autopilot

SLOWEST_US = 1_000_000
"""Slowest interval tried: if it, or a longer wanted one, is refused, the autopilot does not send the message."""
STEP_US = 1000
"""Resolution of intervals: autopilots keep them in whole milliseconds."""
CLOSE_ENOUGH = 1.02
"""Ratio of the fastest accepted interval to the slowest refused one at which the search ends, if above one step."""
MIN_WINDOW_S, MAX_WINDOW_S = 2.0, 30.0
ARRIVALS_PER_WINDOW = 8.0
LONGEST_NS = 10 * NS_PER_S
"""Longest time of counting before an adoption; a longer one would average over changes of the rates."""
MAX_SENDERS = 16
BLAME_NS = 15 * NS_PER_S
"""Time after a station's rate request, or after its heartbeat on our link, for which a fallen rate is attributed to
it."""
MOST_STATIONS = 8
COMMANDS = frozenset({"COMMAND_LONG", "COMMAND_INT"})


class RateSearch:
    """Searches the shortest accepted interval that is not shorter than the wanted one.

    First it tries the wanted interval. If that is refused it tries the slowest, to distinguish a rate that is too high
    from a message that the autopilot does not know. Then it bisects between them on a logarithmic scale. This finds the
    ceiling of an autopilot's scheduler (ArduPilot: 0.8 of the main loop rate) within about ten requests.
    """

    __slots__ = ("_refused_us", "_slowest_us", "accepted_us", "asking_us", "denied")

    def __init__(self, wanted_hz: float):
        wanted_us = max(1, round(1e6 / wanted_hz))
        self._slowest_us = max(SLOWEST_US, wanted_us)
        self._refused_us = 0
        self.accepted_us: int | None = None
        """Shortest accepted interval, microseconds."""
        self.asking_us: int | None = wanted_us
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

    __slots__ = ("_since_ns", "count", "hz")

    def __init__(self, since_ns: HostNs, count: int = 0) -> None:
        """``count``: arrivals since then."""
        self._since_ns = since_ns
        self.count = count
        """Arrivals in the present window."""
        self.hz: float | None = None
        """Rate in the last full window, hertz; None before there was one."""

    def restart(self, now: HostNs) -> None:
        """Begin a window: earlier arrivals were sent at another agreed rate."""
        self.count, self._since_ns = 0, now

    def elapsed_ns(self, now: HostNs) -> int:
        """Return the length of the present window so far."""
        return max(now - self._since_ns, 1)

    def roll(self, now: HostNs, expected_hz: float) -> bool:
        """End the window if it is long enough. Returns True if :attr:`hz` is new."""
        window_s = min(max(MIN_WINDOW_S, ARRIVALS_PER_WINDOW / expected_hz), MAX_WINDOW_S)
        if now - self._since_ns < window_s * NS_PER_S:
            return False
        self.hz = self.count * NS_PER_S / (now - self._since_ns)
        self.restart(now)
        return True


class ArrivalsBefore:
    """Counts each sender's messages until one is adopted, so that the listening before the adoption is not lost."""

    def __init__(self) -> None:
        self._senders: dict[tuple[int, int], tuple[HostNs, Counter[str]]] = {}

    def on_message(self, message: Message, now: HostNs) -> None:
        """Count a message."""
        sender = (message.system, message.component)
        known = self._senders.get(sender)
        if known is None or now - known[0] > LONGEST_NS:
            if known is None and len(self._senders) >= MAX_SENDERS:
                return
            known = self._senders[sender] = (now, Counter())
        if message.name in MESSAGE_IDS:
            known[1][message.name] += 1

    def take(self, system: int, component: int, now: HostNs) -> tuple[HostNs, Counter[str]]:
        """Return the beginning and the counts of the adopted sender, and forget all."""
        senders, self._senders = self._senders, {}
        return senders.get((system, component), (now, Counter()))


class RateCompetitors:
    """Finds which station may have changed our rates: one whose request was seen, or else one that is present.

    Behind a router, or on the same radio, a ground station's requests do not pass through us; its heartbeat shows that
    it is present.
    """

    __slots__ = ("_seen", "_stations")

    def __init__(self) -> None:
        self._seen: tuple[str, HostNs] | None = None
        self._stations: dict[tuple[int, int], HostNs] = {}

    def saw(self, sender: str, now: HostNs) -> bool:
        """Note a station's rate request to the autopilot. Returns True unless the last one was from the same station,
        lately.
        """
        before, self._seen = self._seen, (sender, now)
        return before is None or before[0] != sender or now - before[1] > BLAME_NS

    def on_message(self, message: Message, autopilot: Autopilot, now: HostNs) -> None:
        """Take a message of another component on the autopilot's link."""
        if message.link != autopilot.link:
            return
        sender = (message.system, message.component)
        if message.name == "HEARTBEAT" and message.fields.type == enums.MAV_TYPE_GCS:
            if sender in self._stations or len(self._stations) < MOST_STATIONS:
                self._stations[sender] = now
        elif message.name in COMMANDS and message.fields.command == enums.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.saw(f"{sender[0]}/{sender[1]} on {message.link}", now)

    def to_blame(self, autopilot: Autopilot, now: HostNs) -> str:
        """Return the station whose request was seen, or else the stations that are present and presumed."""
        if self._seen is not None and now - self._seen[1] <= BLAME_NS:
            return self._seen[0]
        present = sorted(sender for sender, heard_ns in self._stations.items() if now - heard_ns <= BLAME_NS)
        names = ", ".join(f"{system}/{component}" for system, component in present)
        return f"presumably the ground station {names} on {autopilot.link}" if names else "no station seen"
