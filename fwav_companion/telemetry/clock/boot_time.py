"""Unwraps the autopilot's 32-bit milliseconds past 49.7 days, and detects a reboot: stamps go back and stay back."""

from __future__ import annotations

from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, BootNs, HostNs

WRAP_NS = 2**32 * NS_PER_MS
"""Period after which time_boot_ms, a uint32 of milliseconds, wraps: 49.7 days."""

MOST_DISORDER_NS = 1 * NS_PER_S
"""Largest distance behind the newest stamp that counts as reordering. Datagrams overtake one another by tens of
milliseconds; two radio links to one autopilot by hundreds."""

MOST_CATCHING_UP_NS = 10 * NS_PER_S
"""Largest lead over the expected stamp that counts as delayed delivery: a link that stalls for seconds and then
delivers makes stamps run ahead of the host's clock."""

STRANGE_STAMPS_FOR_A_REBOOT = 3
STAYS_BACK_NS = 200 * NS_PER_MS
"""Number of consecutive stamps that must agree with one another, and the time over which they must arrive. A single
wild stamp, a slow second link, or a late copy of a few messages is not a reboot."""


LEAST_MISSING_NS = 5 * NS_PER_S
"""Part of a silence that the autopilot's clock must lack to count as rebooted: an autopilot that was silent since
shortly after its boot may return with a later stamp. A simulator that was stopped that long in its first seconds looks
the same, and loses as little."""


class Restarted(msgspec.Struct, frozen=True):
    """The stamps began again: they went back and stayed back."""

    boot_ns: BootNs
    """Stamp that decided the reboot, on the new time line."""


class Skipped(msgspec.Struct, frozen=True):
    """The stamps went far ahead and stayed there: the clock jumped, or this host slept."""

    boot_ns: BootNs
    """Stamp that decided the jump, on the same time line."""
    ahead_ns: int
    """Stamp minus expected stamp, nanoseconds."""


Placed: TypeAlias = "BootNs | Strange | Restarted | Skipped"


class Strange(msgspec.Struct, frozen=True):
    """A stamp that does not continue the time line, and is not enough evidence for a reboot."""


class BootTimeline:
    """Places 32-bit stamps on a monotonic time line, and detects when the autopilot began a new one."""

    __slots__ = ("_newest_arrival_ns", "_suspects", "newest_ns")

    def __init__(self) -> None:
        self.newest_ns: BootNs | None = None
        """Latest instant of the autopilot's clock that was received."""
        self._newest_arrival_ns = HostNs(0)
        self._suspects: list[tuple[int, HostNs]] = []

    def place(self, time_boot_ms: int, arrival_ns: HostNs) -> Placed:
        """Unwrap a stamp of whole milliseconds; it may be up to 1 s older than the newest."""
        newest_ns, silent_ns = self.newest_ns, arrival_ns - self._newest_arrival_ns
        stamp_ns = time_boot_ms * NS_PER_MS
        # Nearly every stamp is a little newer than the last one, and needs none of the checks below.
        if (
            newest_ns is not None
            and 0 <= silent_ns < stamp_ns
            and (newest_ns < stamp_ns <= newest_ns + silent_ns + MOST_CATCHING_UP_NS)
        ):
            self._suspects.clear()
            self.newest_ns, self._newest_arrival_ns = BootNs(stamp_ns), arrival_ns
            return self.newest_ns
        placed = self.align(stamp_ns, arrival_ns)
        if isinstance(placed, int):
            self._advance(placed, arrival_ns)
        return placed

    def align(self, autopilot_ns: int, arrival_ns: HostNs) -> Placed:
        """Move an instant of the same clock (TIMESYNC sends all 64 bits) by whole wraps to the stamps' time line."""
        if self.newest_ns is None:
            return self._begin(autopilot_ns, arrival_ns)
        expected_ns = self._expected(arrival_ns)
        placed_ns = nearest_instant(autopilot_ns, expected_ns)
        continues = self.newest_ns - MOST_DISORDER_NS <= placed_ns <= expected_ns + MOST_CATCHING_UP_NS
        if continues and not self._booted_in_silence(placed_ns, arrival_ns):
            self._suspects.clear()
            return BootNs(placed_ns)
        return self._suspect(autopilot_ns, arrival_ns)

    def _begin(self, stamp_ns: int, arrival_ns: HostNs) -> BootNs:
        self._suspects.clear()
        self.newest_ns, self._newest_arrival_ns = BootNs(stamp_ns), arrival_ns
        return self.newest_ns

    def _expected(self, arrival_ns: HostNs) -> int:
        assert self.newest_ns is not None  # noqa: S101  (both callers asked)
        return self.newest_ns + max(0, arrival_ns - self._newest_arrival_ns)

    def _booted_in_silence(self, placed_ns: int, arrival_ns: HostNs) -> bool:
        """Whether the autopilot was silent for longer than its clock has run, and the clock lacks much of that time."""
        silent_ns = arrival_ns - self._newest_arrival_ns
        return placed_ns <= silent_ns and self._expected(arrival_ns) - placed_ns > LEAST_MISSING_NS

    def _advance(self, placed_ns: int, arrival_ns: HostNs) -> None:
        if self.newest_ns is None or placed_ns > self.newest_ns:
            self.newest_ns, self._newest_arrival_ns = BootNs(placed_ns), arrival_ns

    def _suspect(self, stamp_ns: int, arrival_ns: HostNs) -> Strange | Restarted | Skipped:
        if self._suspects:
            last_ns, last_arrival_ns = self._suspects[-1]
            ahead_ns = stamp_ns - last_ns
            elapsed_ns = arrival_ns - last_arrival_ns
            if not -MOST_DISORDER_NS <= ahead_ns <= elapsed_ns + MOST_CATCHING_UP_NS:
                self._suspects.clear()
        self._suspects.append((stamp_ns, arrival_ns))
        stayed_ns = arrival_ns - self._suspects[0][1]
        if len(self._suspects) < STRANGE_STAMPS_FOR_A_REBOOT or stayed_ns < STAYS_BACK_NS:
            return Strange()
        latest_ns = max(s for s, _ in self._suspects)
        assert self.newest_ns is not None  # noqa: S101  (the caller asked)
        ahead_ns = self.newest_ns // WRAP_NS * WRAP_NS + latest_ns % WRAP_NS - self._expected(arrival_ns)
        if ahead_ns > 0:
            return Skipped(self._begin(ahead_ns + self._expected(arrival_ns), arrival_ns), ahead_ns)
        return Restarted(self._begin(latest_ns, arrival_ns))


def nearest_instant(stamp_ns: int, expected_ns: int) -> int:
    """The instant that differs from ``stamp_ns`` by whole wraps and lies nearest to ``expected_ns``."""
    return stamp_ns + (expected_ns - stamp_ns + WRAP_NS // 2) // WRAP_NS * WRAP_NS
