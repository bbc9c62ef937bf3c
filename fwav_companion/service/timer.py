"""SHELL: the daemon's time: its clock of whole microseconds, and the timer that wakes the pipeline.

A wake-up costs more than most of the work done in it. While telemetry flows, the next message arrives soon, and its
handler first does the work that is due: the timer is then a safety net for the case that all messages stop at once.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, NS_PER_US, HostNs, whole_microseconds
from fwav_companion.vision.frame_receiver import read_clocks
from fwav_companion.vision.wall_clock import WallClock

BUSY_NS = 20 * NS_PER_MS
"""Interval of messages below which their handlers do all due work: no message of the service has a shorter one."""
STEADY_NS = 100 * NS_PER_MS
"""Time for which messages must have arrived without a longer pause: autopilots send bursts with gaps in between."""
FALLBACK_INTERVAL_NS = 200 * NS_PER_MS
"""Largest delay of due work when a busy flow stops at once; during the flow the timer rings five times a second."""


class HostClock:
    """CLOCK_MONOTONIC in whole microseconds, with its offset to the recording's clock and to the wall clock."""

    def __init__(self) -> None:
        host_ns, unix_ns = read_clocks()
        self.started_unix_ns = unix_ns
        self.unix_offset_ns = (unix_ns - host_ns) // NS_PER_US * NS_PER_US
        """Recording's clock minus host clock; fixed at the start, whatever sets the wall clock later."""
        self.wall = WallClock(host_ns, unix_ns)
        self._last_ns = host_ns

    def now(self) -> HostNs:
        """The present instant, different for each event, so that a recording replays in the same order."""
        now = whole_microseconds(time.monotonic_ns())
        self._last_ns = HostNs(max(now, self._last_ns + NS_PER_US))
        return self._last_ns

    def read(self) -> tuple[HostNs, int]:
        """The present instant, and the wall clock at that instant in Unix nanoseconds."""
        host_ns, unix_ns = read_clocks()
        now = self.now()
        return now, unix_ns + now - host_ns

    def unix_us(self, now: HostNs) -> int:
        """The instant on the recording's clock, microseconds."""
        return (now + self.unix_offset_ns) // NS_PER_US


class PipelineTimer:
    """One timer. It is set again only if it would ring too late: a needless ring is cheaper than setting it."""

    def __init__(self, on_ring: Callable[[], None], call_at: Callable[[float, Callable[[], None]], Any] | None = None):
        """``call_at``: method of an event loop, by default the running one, in seconds of the host clock."""
        self._on_ring = on_ring
        self._call_at = call_at
        self._timer: asyncio.TimerHandle | None = None
        self._rings_ns: HostNs | None = None
        self._began_ns = self._heard_ns = HostNs(0)
        self._busy = False

    def heard(self, now: HostNs) -> None:
        """Note an event whose handler does the due work."""
        if now - self._heard_ns >= BUSY_NS:
            self._began_ns = now
        self._busy, self._heard_ns = now - self._began_ns >= STEADY_NS, now

    def arm(self, now: HostNs, due: HostNs | None, strict: HostNs | None = None) -> None:
        """Ring by these instants. ``due``: of work that the next event would do; ``strict``: of the timer's own."""
        rings_ns = self._ring_ns(now, due, strict)
        if rings_ns is None or (self._rings_ns is not None and self._rings_ns <= rings_ns):
            return
        if self._timer is not None:
            self._timer.cancel()
        call_at = self._call_at or asyncio.get_running_loop().call_at
        self._timer, self._rings_ns = call_at(rings_ns / NS_PER_S, self._ring), rings_ns

    def is_early(self, now: HostNs, due: HostNs | None, strict: HostNs | None = None) -> bool:
        """Whether the timer rang for work that is already done, or that the next event will do."""
        self._busy = self._busy and now - self._heard_ns < BUSY_NS
        rings_ns = self._ring_ns(now, due, strict)
        return rings_ns is not None and rings_ns > now

    def _ring(self) -> None:
        self._timer = self._rings_ns = None
        self._on_ring()

    def _ring_ns(self, now: HostNs, due: HostNs | None, strict: HostNs | None) -> HostNs | None:
        first = HostNs(now + FALLBACK_INTERVAL_NS) if self._busy else due
        if first is None or strict is None:
            return first if strict is None else strict
        return min(first, strict)
