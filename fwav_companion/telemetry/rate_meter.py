"""Measures the rate of each message as it arrives."""

from __future__ import annotations

from fwav_companion.geometry.stamps import NS_PER_S, HostNs

WINDOW_NS = 2 * NS_PER_S
SHORTEST_NS = NS_PER_S // 4
"""A first window shorter than this is not evaluated."""
STALL_NS = 3 * NS_PER_S
"""Silence of all messages after which what comes first is a backlog: this process, or the sender's, was stopped."""
BACKLOG_NS = NS_PER_S // 4
"""Time in which a backlog arrives; its messages say nothing about a rate."""
LEAST_BEFORE = 4
"""Messages of a window from which a silence is a stall: photographs come seconds apart."""
MOST_NAMES = 64


class RateMeter:
    """Counts messages by name over the last full window, which began 2 to 4 s ago: cheap, with bounded memory.

    Until the first window is full, the counts so far are used. After a stall it starts again.
    """

    __slots__ = ("_backlog_until_ns", "_full", "_last_ns", "_now", "_since_ns", "_usual")

    def __init__(self) -> None:
        self._since_ns: HostNs | None = None
        self._now: dict[str, int] = {}
        self._full: dict[str, int] | None = None
        self._last_ns: HostNs | None = None
        self._backlog_until_ns = HostNs(0)
        self._usual = 0
        """Messages of all names in the last window that had any."""

    def count(self, name: str, now: HostNs) -> None:
        """Count one message of this name."""
        if self._last_ns is not None and now - self._last_ns >= STALL_NS:
            self._restart_after_stall(now)
        self._last_ns = now
        if now < self._backlog_until_ns:
            return
        if self._since_ns is None or now - self._since_ns >= WINDOW_NS:
            self._turn(now)
        if name in self._now or len(self._now) < MOST_NAMES:
            self._now[name] = self._now.get(name, 0) + 1

    def rates_hz(self, now: HostNs) -> dict[str, float]:
        """Messages a second by name, in order of name."""
        self._turn(now)
        counts, elapsed_ns = self._full, WINDOW_NS
        if counts is None and self._since_ns is not None:
            counts, elapsed_ns = self._now, now - self._since_ns
        if counts is None or elapsed_ns < SHORTEST_NS:
            return {}
        return {name: count / (elapsed_ns * 1e-9) for name, count in sorted(counts.items())}

    def _restart_after_stall(self, now: HostNs) -> None:
        if max(sum(self._now.values()), self._usual) >= LEAST_BEFORE:
            self._since_ns, self._now, self._full = None, {}, None
            self._backlog_until_ns = HostNs(now + BACKLOG_NS)

    def _turn(self, now: HostNs) -> None:
        if self._since_ns is None:
            self._since_ns = now
        elapsed = (now - self._since_ns) // WINDOW_NS
        if elapsed > 0:
            self._usual = sum(self._now.values()) or self._usual
            self._full = self._now if elapsed == 1 else {}
            self._now = {}
            self._since_ns = HostNs(self._since_ns + elapsed * WINDOW_NS)
