"""Unwraps the autopilot's 32-bit milliseconds past 49.7 days, and notices a reboot."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, BootNs, HostNs

WRAP_NS = 2**32 * NS_PER_MS
"""time_boot_ms is a uint32 of milliseconds: 49.7 days."""

MOST_DISORDER_NS = 1 * NS_PER_S
"""Datagrams overtake one another by tens of milliseconds; two radio links to one autopilot by hundreds."""

MOST_CATCHING_UP_NS = 10 * NS_PER_S
"""A link that stalls for seconds and then delivers makes stamps run ahead of the host's clock."""

STRANGE_STAMPS_FOR_A_REBOOT = 3
"""Consecutive stamps that agree with one another: a single wild stamp, or a slow second link, is not a reboot."""


class Restarted(msgspec.Struct, frozen=True):
    """The stamps began again."""

    boot_ns: BootNs
    """Stamp that decided it, on the new time line."""


class Strange(msgspec.Struct, frozen=True):
    """A stamp that does not continue the time line, and is not enough evidence for a reboot."""


class BootTimeline:
    """Places 32-bit stamps on a monotonic time line, and notices when the autopilot began another."""

    __slots__ = ("_newest_arrival_ns", "_suspects", "newest_ns")

    def __init__(self) -> None:
        self.newest_ns: BootNs | None = None
        """Latest instant of the autopilot's clock that was received."""
        self._newest_arrival_ns = HostNs(0)
        self._suspects: list[tuple[int, HostNs]] = []

    def place(self, time_boot_ms: int, arrival_ns: HostNs) -> BootNs | Strange | Restarted:
        """A whole-millisecond stamp, unwrapped; it may be up to 1 s older than the newest."""
        stamp_ns = time_boot_ms * NS_PER_MS
        if self.newest_ns is None:
            return self._begin(stamp_ns, arrival_ns)
        expected_ns = self._expected(arrival_ns)
        placed_ns = _nearest(stamp_ns, expected_ns)
        if self.newest_ns - MOST_DISORDER_NS <= placed_ns <= expected_ns + MOST_CATCHING_UP_NS:
            self._suspects.clear()
            self._advance(placed_ns, arrival_ns)
            return BootNs(placed_ns)
        return self._suspect(stamp_ns, arrival_ns)

    def align(self, autopilot_ns: int, arrival_ns: HostNs) -> BootNs:
        """A full instant of the same clock (TIMESYNC), moved by whole wraps to where the stamps run."""
        if self.newest_ns is None:
            return self._begin(autopilot_ns, arrival_ns)
        return BootNs(_nearest(autopilot_ns, self._expected(arrival_ns)))

    def forget(self) -> None:
        """Treat the next stamp as the first."""
        self.newest_ns = None
        self._suspects.clear()

    def _begin(self, stamp_ns: int, arrival_ns: HostNs) -> BootNs:
        self._suspects.clear()
        self.newest_ns, self._newest_arrival_ns = BootNs(stamp_ns), arrival_ns
        return self.newest_ns

    def _expected(self, arrival_ns: HostNs) -> int:
        assert self.newest_ns is not None  # noqa: S101  (both callers asked)
        return self.newest_ns + max(0, arrival_ns - self._newest_arrival_ns)

    def _advance(self, placed_ns: int, arrival_ns: HostNs) -> None:
        if self.newest_ns is None or placed_ns > self.newest_ns:
            self.newest_ns, self._newest_arrival_ns = BootNs(placed_ns), arrival_ns

    def _suspect(self, stamp_ns: int, arrival_ns: HostNs) -> Strange | Restarted:
        if self._suspects:
            last_ns, last_arrival_ns = self._suspects[-1]
            ahead_ns = stamp_ns - last_ns
            elapsed_ns = arrival_ns - last_arrival_ns
            if not -MOST_DISORDER_NS <= ahead_ns <= elapsed_ns + MOST_CATCHING_UP_NS:
                self._suspects.clear()
        self._suspects.append((stamp_ns, arrival_ns))
        if len(self._suspects) < STRANGE_STAMPS_FOR_A_REBOOT:
            return Strange()
        return Restarted(self._begin(max(s for s, _ in self._suspects), arrival_ns))


def _nearest(stamp_ns: int, expected_ns: int) -> int:
    """The instant that differs from ``stamp_ns`` by whole wraps and lies nearest to ``expected_ns``."""
    return stamp_ns + (expected_ns - stamp_ns + WRAP_NS // 2) // WRAP_NS * WRAP_NS
