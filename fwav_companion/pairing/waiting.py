"""The queue of frames that wait for attitudes after their capture, so that attitudes are interpolated. Bounded."""

from __future__ import annotations

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
            if index < crowd or until is None or now >= entry.deadline_ns or vehicle.ready_for(until):
                ready.append(entry.frame)
            else:
                waiting.append(entry)
        self._frames = waiting
        return ready
