"""Counts the arrivals of each message before the first request of this service changes its rate."""

from __future__ import annotations

from collections import Counter

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.client.subscriptions import MESSAGE_IDS
from fwav_companion.types.messages import Message
from fwav_companion.types.situation import Autopilot

ENOUGH_NS = 2 * NS_PER_S
"""Least time of counting: as long as an answer to GET_MESSAGE_INTERVAL is awaited."""
LONGEST_NS = 10 * NS_PER_S
"""Longest time of counting before an adoption; a longer one would average over changes of the rates."""
MAX_SENDERS = 16


class ArrivalsBefore:
    """Counts per sender until one is adopted, and then that one's: the listening before the adoption is not lost."""

    def __init__(self) -> None:
        self._senders: dict[tuple[int, int], tuple[HostNs, Counter[str]]] = {}
        self._counts: Counter[str] = Counter()
        self._since_ns = HostNs(0)
        self._reset_ns: dict[str, HostNs] = {}

    @property
    def enough_at(self) -> HostNs:
        """Time at which the adopted autopilot's counts last long enough."""
        return HostNs(self._since_ns + ENOUGH_NS)

    def on_message(self, message: Message, now: HostNs) -> None:
        """Count a message that came before an adoption."""
        sender = (message.system, message.component)
        known = self._senders.get(sender)
        if known is None or now - known[0] > LONGEST_NS:
            if known is None and len(self._senders) >= MAX_SENDERS:
                return
            known = self._senders[sender] = (now, Counter())
        if message.name in MESSAGE_IDS:
            known[1][message.name] += 1

    def adopt(self, autopilot: Autopilot, now: HostNs) -> None:
        """Go on with the counts of this autopilot."""
        self._since_ns, self._counts = self._senders.get((autopilot.system, autopilot.component), (now, Counter()))
        self._senders.clear()
        self._reset_ns.clear()

    def restart(self, now: HostNs) -> None:
        """Restart the counts, after a reboot."""
        self._since_ns, self._counts = now, Counter()
        self._reset_ns.clear()

    def reset(self, name: str, now: HostNs) -> None:
        """Restart the count of one message, because its rate was set to its default now."""
        self._counts[name], self._reset_ns[name] = 0, now

    def count(self, name: str) -> None:
        """Count one message of the adopted autopilot."""
        self._counts[name] += 1

    def taken(self, name: str, now: HostNs) -> tuple[int, int]:
        """Return the count of one message, and its time, nanoseconds."""
        return self._counts[name], max(now - self._reset_ns.get(name, self._since_ns), 1)
