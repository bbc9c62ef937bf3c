"""SHELL: receiver shared by all detection sources: stamps arrivals and parses frames."""

from __future__ import annotations

import time
from collections.abc import Callable

import msgspec

from fwav_companion.geometry.stamps import HostNs, whole_microseconds
from fwav_companion.types import Frame, NoFrame
from fwav_companion.vision.wall_clock import ClockStep, WallClock
from fwav_companion.vision.wire import parse_frame

CLOCKS_APART_NS = 200_000
"""A reading of both clocks that took longer was interrupted, and is repeated."""


def read_clocks() -> tuple[HostNs, int]:
    """The host clock and the wall clock at one instant, nanoseconds."""
    for _ in range(5):
        before = time.monotonic_ns()
        unix_ns = time.time_ns()
        after = time.monotonic_ns()
        if after - before < CLOCKS_APART_NS:
            break
    return whole_microseconds((before + after) // 2), unix_ns


class FrameReceiver(msgspec.Struct, frozen=True):
    """Receiver of one daemon, shared by its sources."""

    on_frame: Callable[[Frame | NoFrame], None]
    on_step: Callable[[ClockStep], None]
    """Called when the wall clock was set."""
    wall_clock: WallClock
    clocks: Callable[[], tuple[HostNs, int]] = read_clocks

    def arrival(self) -> HostNs:
        """The host instant of an arrival, now. Calls ``on_step`` if the wall clock was set since the last one."""
        arrival_ns, unix_ns = self.clocks()
        step = self.wall_clock.observe(arrival_ns, unix_ns)
        if step is not None:
            self.on_step(step)
        return arrival_ns

    def hear(self, data: bytes, arrival_ns: HostNs) -> None:
        """Parse a datagram and pass on the frame, or the reason why it is not one."""
        self.on_frame(parse_frame(data, arrival_ns, self.wall_clock))
