"""Delayed measurement queue: fixes wait until the vehicle states around their capture are known."""

from __future__ import annotations

from collections.abc import Collection

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs, s_from_ns
from fwav_companion.self_calibration.pixel_measurement import MeasurementBatch
from fwav_companion.types import GroundFix

BATCH_NS = 70 * NS_PER_MS
"""Frames within this time are measured as one batch, three at 30 frames/s: an update costs the same whatever its size,
and places change by millimetres meanwhile."""
NO_FRAME_NS = 500 * NS_PER_MS
"""Wait for a further frame, before what is due is measured without one. Attitudes are kept for 3 s."""


class DelayedMeasurement(msgspec.Struct, frozen=True):
    """The fixes of one frame, by track."""

    host_ns: HostNs
    fixes: tuple[tuple[int, GroundFix], ...]
    batch: MeasurementBatch | None = None
    """Their measurements where the gate needed them already."""


class MeasurementQueue(msgspec.Struct, frozen=True):
    """The waiting frames, in the order of their capture, and the last measurement of each track. Immutable."""

    waiting: tuple[DelayedMeasurement, ...] = ()
    taken_ns: dict[int, HostNs] = {}
    """Capture of the last measurement of each track."""

    def with_frame(self, frame: DelayedMeasurement) -> MeasurementQueue:
        """The queue with one more frame."""
        return MeasurementQueue((*self.waiting, frame), self.taken_ns)

    def due(self, due_ns: HostNs) -> tuple[list[tuple[DelayedMeasurement, ...]], MeasurementQueue]:
        """Groups of frames, the first BATCH_NS and more before ``due_ns``, and the rest."""
        groups, waiting = list[tuple[DelayedMeasurement, ...]](), self.waiting
        while waiting and waiting[0].host_ns <= due_ns - BATCH_NS:
            until_ns, count = waiting[0].host_ns + BATCH_NS, 1
            while count < len(waiting) and waiting[count].host_ns <= until_ns:
                count += 1
            groups.append(waiting[:count])
            waiting = waiting[count:]
        return groups, MeasurementQueue(waiting, self.taken_ns)

    def due_without_frame(self, lag_ns: int) -> HostNs | None:
        """Instant at which what waits is due although no further frame comes; None where nothing waits."""
        return HostNs(self.waiting[0].host_ns + lag_ns + BATCH_NS + NO_FRAME_NS) if self.waiting else None

    def taken(
        self, frame: DelayedMeasurement, alive: Collection[int]
    ) -> tuple[list[int], list[float], MeasurementQueue]:
        """Indices of the frame's fixes of live tracks in the order of the tracks, and the seconds since the previous
        measurement of each; 0 for the first.
        """
        index = sorted(
            (i for i, (track, _) in enumerate(frame.fixes) if track in alive), key=lambda i: frame.fixes[i][0]
        )
        tracks = [frame.fixes[i][0] for i in index]
        since = [s_from_ns(frame.host_ns - self.taken_ns.get(track, frame.host_ns)) for track in tracks]
        before = {track: taken_ns for track, taken_ns in self.taken_ns.items() if track in alive}
        return index, since, MeasurementQueue(self.waiting, before | dict.fromkeys(tracks, frame.host_ns))
