"""SHELL: the queue of datagrams before the pipeline. It limits the work in a turn of the loop, and drops old frames.

A frame of 256 detections costs some 50 ms here (15 in the tracker) and ten times as long on a small board. After
SLICE_S no further frame is begun in a turn, so that heartbeats, TIMESYNC and the relay have their turn between two
frames. A frame that has waited for PATIENCE_S, or a full queue, shows that frames arrive faster than the processor
handles them: from then on the newest is taken, and those before it are dropped as OVERLOAD, until the queue is empty.

Frames that wait in the pipeline for attitudes are processed all at once when an attitude arrives. So the queue holds
frames back while the waiting ones would take longer than BURST_S, by the mean CPU time of a detection.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable
from typing import Final

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.types import Notice, NoticeCode, Severity

SLICE_S: Final = 0.005
"""Work in one turn after which no further frame is begun, seconds: half the interval of attitudes at 100 Hz."""
PATIENCE_S: Final = 0.25
"""Longest wait of a frame while the processor keeps up, seconds: half of the time after which a frame is too late."""
BURST_S: Final = 0.1
"""Longest work that may wait in the pipeline, seconds: a tenth of the heartbeats' interval, and that of TIMESYNC."""
HELD_S: Final = 0.01
"""Interval at which frames that are held back are tried again, seconds."""
MOST_WAITING: Final = 32
"""Most datagrams in the queue, 2 MiB at most: one second at 30 Hz."""
COST_SHARE: Final = 0.1
"""Weight of a new measurement in the mean cost of a detection."""
REPORT_NS: Final = 60 * NS_PER_S
LEAST_REPORTED: Final = 30
"""Least number of dropped frames for a notice: a second of a camera. Other programs may use the processor as long."""


class FrameQueue:
    """Datagrams that wait for the processor."""

    def __init__(
        self,
        take: Callable[[bytes], None],
        on_drop: Callable[[], None],
        backlog: Callable[[], int] = lambda: 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """``take`` processes one datagram; ``on_drop`` is called for each that is dropped. ``backlog``: detections that
        wait in the pipeline.
        """
        self._take = take
        self._on_drop = on_drop
        self._backlog = backlog
        self._clock = clock
        self._waiting: deque[tuple[float, bytes]] = deque()
        """(arrival, datagram)."""
        self._resting = False
        """Whether the next slice is scheduled."""
        self._shedding = False
        self._cost_s = 0.0
        """Mean CPU time of one detection, seconds."""
        self.came = 0
        self.dropped = 0
        self._reported = (0, 0)
        self._reported_ns: HostNs | None = None

    def put(self, data: bytes) -> None:
        """Add a datagram; it is processed at once if none waits."""
        self.came += 1
        self._waiting.append((self._clock(), data))
        if len(self._waiting) > MOST_WAITING:
            self._shedding = True
            self._drop_oldest()
        if not self._resting:
            self._work()

    def spent(self, cpu_s: float, detections: int) -> None:
        """Update the mean cost with the CPU time of a number of detections."""
        if detections > 0:
            self._cost_s += COST_SHARE * (cpu_s / detections - self._cost_s)

    def notices(self, now: HostNs) -> list[Notice]:
        """A notice of the frames dropped since the last one, at most once a minute."""
        came, dropped = self.came - self._reported[0], self.dropped - self._reported[1]
        if dropped < LEAST_REPORTED or (self._reported_ns is not None and now - self._reported_ns < REPORT_NS):
            return []
        self._reported, self._reported_ns = (self.came, self.dropped), now
        text = (
            f"frames come faster than this board handles them: {dropped} of {came} were dropped. Send fewer frames, or"
            " fewer detections in each"
        )
        return [Notice(NoticeCode.OVERLOAD, Severity.WARNING, text, to_ground=True)]

    def _work(self) -> None:
        """Process frames for one slice; the next turn of the loop continues, even after an error."""
        self._resting = True
        asyncio.get_running_loop().call_soon(self._go_on)
        ends_s = self._clock() + SLICE_S
        while self._waiting and not self._is_held():
            self._take(self._next())
            if self._clock() >= ends_s:
                return

    def _go_on(self) -> None:
        self._resting = bool(self._waiting) and self._is_held()
        if self._resting:
            asyncio.get_running_loop().call_later(HELD_S, self._go_on)
        elif self._waiting:
            self._work()

    def _next(self) -> bytes:
        """The datagram that is processed next: the oldest, and under overload the newest."""
        if self._clock() - self._waiting[0][0] > PATIENCE_S:
            self._shedding = True
        if self._shedding:
            self._shedding = len(self._waiting) > 1
            while len(self._waiting) > 1:
                self._drop_oldest()
        return self._waiting.popleft()[1]

    def _is_held(self) -> bool:
        return self._cost_s * self._backlog() > BURST_S

    def _drop_oldest(self) -> None:
        self._waiting.popleft()
        self.dropped += 1
        self._on_drop()
