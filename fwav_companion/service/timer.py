"""When the flow is woken by the clock: only where nothing comes that would do what is due on its way.

A wake costs more than most of the work that is done in it. While telemetry flows, the next message is never far, and
does what is due before its own work; the timer is then a net for the case that all falls silent at once.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs

BUSY_NS = 20 * NS_PER_MS
"""What comes more often than this does all that is due on its way: nothing that we send has a shorter interval."""
STEADY_NS = 100 * NS_PER_MS
"""So long it must have come without a longer pause: autopilots send bursts, and what is due behind one is late."""
NET_NS = 200 * NS_PER_MS
"""So late the timer finds what is due when a busy flow ends all at once; until then it rings five times a second."""


class PipelineTimer:
    """One timer. It is set anew only where it would ring too late: a ring for nothing is cheaper than setting it."""

    def __init__(self, on_ring: Callable[[], None], call_at: Callable[[float, Callable[[], None]], Any] | None = None):
        """``call_at``: of the event loop, the running one if not given; seconds of its clock, which is the host's."""
        self._on_ring = on_ring
        self._call_at = call_at
        self._timer: asyncio.TimerHandle | None = None
        self._rings_ns: HostNs | None = None
        self._began_ns = self._heard_ns = HostNs(0)
        self._busy = False

    def heard(self, now: HostNs) -> None:
        """Something came that does what is due."""
        if now - self._heard_ns >= BUSY_NS:
            self._began_ns = now
        self._busy, self._heard_ns = now - self._began_ns >= STEADY_NS, now

    def arm(self, now: HostNs, due: HostNs | None, strict: HostNs | None = None) -> None:
        """Ring by these instants: what whoever comes next does as well, and what nobody else does."""
        rings_ns = self._ring_ns(now, due, strict)
        if rings_ns is None or (self._rings_ns is not None and self._rings_ns <= rings_ns):
            return
        if self._timer is not None:
            self._timer.cancel()
        call_at = self._call_at or asyncio.get_running_loop().call_at
        self._timer, self._rings_ns = call_at(rings_ns / NS_PER_S, self._ring), rings_ns

    def is_early(self, now: HostNs, due: HostNs | None, strict: HostNs | None = None) -> bool:
        """After a ring: it was set for what has been done meanwhile, or is done by what still comes."""
        self._busy = self._busy and now - self._heard_ns < BUSY_NS
        rings_ns = self._ring_ns(now, due, strict)
        return rings_ns is not None and rings_ns > now

    def _ring(self) -> None:
        self._timer = self._rings_ns = None
        self._on_ring()

    def _ring_ns(self, now: HostNs, due: HostNs | None, strict: HostNs | None) -> HostNs | None:
        first = HostNs(now + NET_NS) if self._busy else due
        if first is None or strict is None:
            return first if strict is None else strict
        return min(first, strict)
