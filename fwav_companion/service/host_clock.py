"""SHELL: the host's clock as a flight sees it: whole microseconds, each event an instant of its own, never stepped."""

from __future__ import annotations

import time

from fwav_companion.geometry.stamps import NS_PER_US, HostNs, whole_microseconds
from fwav_companion.vision.frame_receiver import read_clocks
from fwav_companion.vision.wall_clock import WallClock


class HostClock:
    """CLOCK_MONOTONIC, and what the recording's clock and the wall clock are beside it."""

    def __init__(self) -> None:
        host_ns, unix_ns = read_clocks()
        self.started_unix_ns = unix_ns
        self.unix_offset_ns = (unix_ns - host_ns) // NS_PER_US * NS_PER_US
        """Of the recording: fixed for good, whatever is done to the wall clock."""
        self.wall = WallClock(host_ns, unix_ns)
        self._last_ns = host_ns

    def now(self) -> HostNs:
        """An instant that no other event has, so that a recording replays in the same order."""
        now = whole_microseconds(time.monotonic_ns())
        self._last_ns = HostNs(max(now, self._last_ns + NS_PER_US))
        return self._last_ns

    def read(self) -> tuple[HostNs, int]:
        """The same, and the wall clock at that instant, Unix nanoseconds."""
        host_ns, unix_ns = read_clocks()
        now = self.now()
        return now, unix_ns + now - host_ns

    def unix_us(self, now: HostNs) -> int:
        """The instant on the recording's clock."""
        return (now + self.unix_offset_ns) // NS_PER_US
