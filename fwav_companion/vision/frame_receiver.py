"""SHELL: receiver shared by all detection sources: queues datagrams, stamps arrivals and parses frames."""

from __future__ import annotations

import time
from collections.abc import Callable

from fwav_companion.geometry.stamps import HostNs, whole_microseconds
from fwav_companion.types import Frame, NoFrame, Reason
from fwav_companion.vision.frame_queue import FrameQueue
from fwav_companion.vision.wall_clock import ClockStep, WallClock
from fwav_companion.vision.wire import parse_frame

CLOCKS_APART_NS = 200_000
"""Longest time for a reading of both clocks: a longer one was interrupted, and is repeated."""


def read_clocks() -> tuple[HostNs, int]:
    """The host clock and the wall clock at one instant, nanoseconds."""
    for _ in range(5):
        before = time.monotonic_ns()
        unix_ns = time.time_ns()
        after = time.monotonic_ns()
        if after - before < CLOCKS_APART_NS:
            break
    return whole_microseconds((before + after) // 2), unix_ns


class FrameReceiver:
    """Receiver of one daemon, shared by its sources."""

    def __init__(
        self,
        on_frame: Callable[[Frame | NoFrame], None],
        on_step: Callable[[ClockStep], None],
        wall_clock: WallClock,
        clocks: Callable[[], tuple[HostNs, int]] = read_clocks,
        backlog: Callable[[], int] = lambda: 0,
    ) -> None:
        """``on_step`` is called when the wall clock was set. ``backlog``: detections that wait in the pipeline."""
        self.on_frame = on_frame
        self._on_step = on_step
        self._wall_clock = wall_clock
        self._clocks = clocks
        self.queue = FrameQueue(self._take, lambda: self.on_frame(NoFrame(Reason.OVERLOAD)), backlog)

    def hear(self, data: bytes) -> None:
        """Queue a datagram; in its turn it is parsed, and the frame, or the reason why it is not one, is passed on."""
        self.queue.put(data)

    def _take(self, data: bytes) -> None:
        arrival_ns, unix_ns = self._clocks()
        step = self._wall_clock.observe(arrival_ns, unix_ns)
        if step is not None:
            self._on_step(step)
        self.on_frame(parse_frame(data, arrival_ns, self._wall_clock))
