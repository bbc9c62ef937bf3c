"""The queue of frames that wait for attitudes after their capture, so that attitudes are interpolated. Bounded."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.pairing.protocols import VehicleSource
from fwav_companion.types import Frame

LEAST_PATIENCE_NS = 150_000_000
"""Least wait after the arrival: three attitudes at 25 Hz, the slowest stream that resolves flapping, and transport."""
LONGEST_WAIT_NS = 400_000_000
"""Longest wait after the arrival: one attitude at 4 Hz, the usual request of a ground station, and transport."""
LONGEST_AGE_NS = 430_000_000
"""Longest wait after the capture, unless that is below the least wait: lines are written 0.5 s after the capture."""
MOST_WAITING = 64
"""Most frames in the queue: 150 ms at 400 frames/s, 400 ms at 160; a further frame releases the oldest at once."""


class Waiting(msgspec.Struct, frozen=True):
    """A frame in the queue."""

    frame: Frame
    until_boot_ns: BootNs | None
    """Autopilot instant that attitudes should reach; None: the frame need not wait."""
    deadline_ns: HostNs
    """Host instant of its release at the latest."""
    needs_clock: bool = False
    """Whether it waits for the clock first, which gives :attr:`until_boot_ns`."""


class WaitingFrames:
    """Queue of frames that wait for attitudes. Ready frames leave it in the order of their arrival."""

    __slots__ = ("_frames",)

    def __init__(self) -> None:
        self._frames: list[Waiting] = []

    def __len__(self) -> int:
        return len(self._frames)

    def put(self, frame: Frame, until_boot_ns: BootNs | None, until_ns: HostNs, now: HostNs) -> None:
        """Add a frame with the instant that attitudes should reach, on both clocks.

        Call :meth:`take_ready` afterwards: the frame may be ready at once.
        """
        deadline = max(now + LEAST_PATIENCE_NS, min(now + LONGEST_WAIT_NS, until_ns + LONGEST_AGE_NS))
        self._frames.append(Waiting(frame, until_boot_ns, HostNs(deadline)))

    def put_without_clock(self, frame: Frame, now: HostNs) -> None:
        """Add a frame whose capture on the autopilot's clock is not known yet: three exchanges take 0.3 s.

        It waits no longer than one for attitudes, because its lines are written 0.5 s after the capture.
        """
        self._frames.append(Waiting(frame, None, HostNs(now + LONGEST_WAIT_NS), needs_clock=True))

    def place(self, needed_until: Callable[[Frame], BootNs | None], now: HostNs) -> None:
        """Give the frames without a clock the instant that attitudes should reach, where the clock is known now."""
        for index, entry in enumerate(self._frames):
            if entry.needs_clock and (until := needed_until(entry.frame)) is not None:
                deadline_ns = HostNs(min(entry.deadline_ns, now + LEAST_PATIENCE_NS))
                self._frames[index] = Waiting(entry.frame, until, deadline_ns)

    @property
    def needs_clock(self) -> bool:
        """Whether a frame waits for the clock."""
        for entry in self._frames:  # noqa: SIM110  (a generator is a call more for each frame)
            if entry.needs_clock:
                return True
        return False

    @property
    def detections(self) -> int:
        """Number of detections in the queue."""
        return sum(len(entry.frame.detections) for entry in self._frames) if self._frames else 0

    @property
    def wake_at(self) -> HostNs | None:
        """The next deadline; None for an empty queue."""
        return min(entry.deadline_ns for entry in self._frames) if self._frames else None

    def take_ready(self, now: HostNs, vehicle: VehicleSource) -> list[Frame]:
        """Remove and return the frames whose attitudes are complete or whose deadline has passed, in their order."""
        if not self._frames:
            return []
        crowd = len(self._frames) - MOST_WAITING
        ready, waiting = [], []
        for index, entry in enumerate(self._frames):
            until = entry.until_boot_ns
            attitudes_known = not entry.needs_clock and (until is None or vehicle.ready_for(until))
            if index < crowd or attitudes_known or now >= entry.deadline_ns:
                ready.append(entry.frame)
            else:
                waiting.append(entry)
        self._frames = waiting
        return ready
