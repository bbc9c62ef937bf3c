"""Frames that wait, bounded, for the attitudes after their capture, so that these are interpolated."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.pairing.protocols import VehicleSource
from fwav_companion.types import Frame

LEAST_PATIENCE_NS = 150_000_000
"""After its coming: three attitudes at 25 Hz, the slowest stream that carries flapping, and the way they travel."""
LONGEST_WAIT_NS = 400_000_000
"""After its coming: one attitude at 4 Hz, which is what a ground station asks for, and the way it travels."""
LONGEST_AGE_NS = 430_000_000
"""Of what was seen, unless that cuts the patience: half a second after its capture a frame's lines are written."""
MOST_WAITING = 64
"""150 ms of a camera at 400 frames/s, 400 ms of one at 160; of more, the oldest goes on at once."""


class Waiting(msgspec.Struct, frozen=True):
    """A frame and what it waits for."""

    frame: Frame
    until_boot_ns: BootNs | None
    """The attitudes must reach beyond this instant; None: there is nothing to wait for."""
    deadline_ns: HostNs


class WaitingFrames:
    """First come, first served among those that are ready."""

    __slots__ = ("_frames",)

    def __init__(self) -> None:
        self._frames: list[Waiting] = []

    def __len__(self) -> int:
        return len(self._frames)

    def put(self, frame: Frame, until_boot_ns: BootNs | None, until_ns: HostNs, now: HostNs) -> None:
        """A frame arrived, with the instant that attitudes should reach on both clocks; ask :meth:`take_ready` at once,
        it may not have to wait.
        """
        deadline = max(now + LEAST_PATIENCE_NS, min(now + LONGEST_WAIT_NS, until_ns + LONGEST_AGE_NS))
        self._frames.append(Waiting(frame, until_boot_ns, HostNs(deadline)))

    @property
    def wake_at(self) -> HostNs | None:
        """When the first one has waited long enough."""
        return min(entry.deadline_ns for entry in self._frames) if self._frames else None

    def take_ready(self, now: HostNs, vehicle: VehicleSource) -> list[Frame]:
        """Those that need not, or may not, wait any longer, in the order they came."""
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
