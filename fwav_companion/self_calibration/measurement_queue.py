"""Delayed measurement queue: fixes wait until the vehicle states around their capture are known."""

from __future__ import annotations

from collections.abc import Collection
from math import inf
from operator import itemgetter
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs, s_from_ns
from fwav_companion.types import GroundFix

BATCH_NS, MOST_SIGHTS = 200 * NS_PER_MS, 40
"""Time span and most fixes of the frames that form one batch: an update with a few fixes costs the same as with many.
The vehicle's position error, if of the quick kind, moves by 0.03 m within a batch, a third of the noise of one report.
With 0.3 s the delay on circles of ArduCopter's simulator was claimed a sixth too small, to 1.3 ms. The matrices of
40 fixes of ten targets are so small that OpenBLAS uses one thread for each, whatever the environment allows: with 60
fixes, two threads took ten times the CPU of one."""
SAMPLE_NS = 105 * NS_PER_MS
"""Time span of the frames that share one sample of the vehicle's path and of its slow rates, four at 30 frames/s:
positions come at 10 Hz."""
SEARCH_NS = 70 * NS_PER_MS
"""Time span of a batch while the delay is searched, three frames at 30/s. With 0.3 s, one of thirty flights over
targets 1.5 m apart ended with wrong places; with 0.1 s, two over targets 3 m apart ended without a delay."""
NO_FRAME_NS = 500 * NS_PER_MS
"""Time to wait for a further frame before due fixes are used without one. Attitudes are kept for 3 s."""


class DelayedMeasurement(msgspec.Struct, frozen=True):
    """The fixes of one frame that wait for their update."""

    host_ns: HostNs
    """Capture of the frame, host clock."""
    fixes: tuple[tuple[int, GroundFix], ...]
    """Track and fix of each association."""


Frames: TypeAlias = tuple[DelayedMeasurement, ...]


def samples_of(frames: Frames) -> list[Frames]:
    """The frames grouped by the telemetry sample that they share (SAMPLE_NS)."""
    found = list[Frames]()
    while frames:
        found.append(_within(frames, SAMPLE_NS))
        frames = frames[len(found[-1]) :]
    return found


def _within(frames: Frames, span_ns: int, most_sights: float = inf) -> Frames:
    """The first frames within ``span_ns`` with at most ``most_sights`` fixes; at least one frame."""
    count, sights = 1, len(frames[0].fixes)
    for frame in frames[1:]:
        sights += len(frame.fixes)
        if frame.host_ns > frames[0].host_ns + span_ns or sights > most_sights:
            break
        count += 1
    return frames[:count]


class MeasurementQueue(msgspec.Struct, frozen=True):
    """The waiting frames, in the order of their capture, and the last measurement of each track. Immutable."""

    waiting: Frames = ()
    taken_ns: dict[int, HostNs] = {}
    """Capture of the last measurement of each track."""

    def with_frame(self, frame: DelayedMeasurement) -> MeasurementQueue:
        """The queue with one more frame."""
        return MeasurementQueue((*self.waiting, frame), self.taken_ns)

    def before(self, track: int, host_ns: HostNs) -> GroundFix | None:
        """The newest waiting fix of a track before this capture; None where no such fix waits."""
        frames = [frame for frame in self.waiting if frame.host_ns < host_ns]
        own = [fix for frame in frames for of, fix in frame.fixes if of == track]
        return own[-1] if own else None

    def due(self, due_ns: HostNs, span_ns: int = BATCH_NS) -> tuple[list[Frames], MeasurementQueue]:
        """The frames of each batch that is due, and the queue without them.

        A batch is due when its first frame is ``span_ns`` or more before ``due_ns``.
        """
        batches, waiting = list[Frames](), self.waiting
        while waiting and waiting[0].host_ns <= due_ns - span_ns:
            first = _within(waiting, span_ns, MOST_SIGHTS)
            batches.append(first)
            waiting = waiting[len(first) :]
        return batches, self if not batches else MeasurementQueue(waiting, self.taken_ns)

    def due_without_frame(self, lag_ns: int) -> HostNs | None:
        """Instant at which the waiting frames are due without a further frame; None where no frame waits."""
        return HostNs(self.waiting[0].host_ns + lag_ns + BATCH_NS + NO_FRAME_NS) if self.waiting else None

    def taken(
        self, frames: Frames, alive: Collection[int]
    ) -> tuple[list[tuple[int, GroundFix]], list[float], MeasurementQueue]:
        """The fixes of live tracks in the order of frames and tracks, the seconds since the previous measurement of
        each one's track (0 for the first), and the queue with these captures noted.
        """
        fixes, since_s = list[tuple[int, GroundFix]](), list[float]()
        taken_ns = {track: taken_ns for track, taken_ns in self.taken_ns.items() if track in alive}
        for frame in frames:
            own = sorted([each for each in frame.fixes if each[0] in alive], key=itemgetter(0))
            since_s += [s_from_ns(frame.host_ns - taken_ns.get(track, frame.host_ns)) for track, _ in own]
            taken_ns |= dict.fromkeys([track for track, _ in own], frame.host_ns)
            fixes += own
        return fixes, since_s, MeasurementQueue(self.waiting, taken_ns)
