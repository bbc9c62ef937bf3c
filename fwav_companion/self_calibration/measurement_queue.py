"""What self-calibration is to be taught: fixes that wait for the states around their capture, and whose turn it is.

A frame with twenty targets must not cost more than a frame's time. Those wait that were taken last: each target teaches
less often, and all of them together as much.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.types import GroundFix

LEAST_TAKEN = 2
MOST_MOVED = 2000
"""Of one frame so many fixes are taken as move no more entries of the joint covariance together: all of five targets,
and two of nine or more. Of ten targets each is taken six times a second then, at 30 frames/s."""

Taken: TypeAlias = tuple[int, GroundFix, float]
"""A track, its fix, and the seconds since the fix of it that was taken before; 0: none was."""


class DelayedMeasurement(msgspec.Struct, frozen=True):
    """One frame."""

    host_ns: HostNs
    fixes: tuple[tuple[int, GroundFix], ...]
    """By track."""


class MeasurementQueue(msgspec.Struct, frozen=True):
    """The frames that wait, in the order of their capture, and what was taken of those before. Immutable."""

    waiting: tuple[DelayedMeasurement, ...] = ()
    taken_ns: dict[int, HostNs] = {}
    """When each track was taken last, the last one last."""

    def with_frame(self, host_ns: HostNs, fixes: Sequence[tuple[int, GroundFix]]) -> MeasurementQueue:
        """With one frame more."""
        return MeasurementQueue((*self.waiting, DelayedMeasurement(host_ns, tuple(fixes))), self.taken_ns)

    def due(self, due_ns: HostNs) -> tuple[tuple[DelayedMeasurement, ...], MeasurementQueue]:
        """The frames up to an instant, and the rest."""
        count = 0
        while count < len(self.waiting) and self.waiting[count].host_ns <= due_ns:
            count += 1
        return self.waiting[:count], MeasurementQueue(self.waiting[count:], self.taken_ns)

    def taken(
        self, lesson: DelayedMeasurement, most: int, alive: Collection[int], first: Collection[int] = ()
    ) -> tuple[list[Taken], MeasurementQueue]:
        """At most so many fixes of a frame, of tracks that are ``alive``: those of ``first`` before others, then those
        that waited the longest.
        """
        before = {track: taken_ns for track, taken_ns in self.taken_ns.items() if track in alive}
        turn = {track: place for place, track in enumerate(before)}
        fixes = [(track, fix) for track, fix in lesson.fixes if track in alive]
        fixes.sort(key=lambda each: (each[0] not in first, turn.get(each[0], -1)))
        taken = []
        for track, fix in fixes[:most]:
            since_ns = lesson.host_ns - before.pop(track, lesson.host_ns)
            taken.append((track, fix, s_from_ns(since_ns)))
        return taken, MeasurementQueue(
            self.waiting, before | dict.fromkeys([track for track, _ in fixes[:most]], lesson.host_ns)
        )


def most_taken(unknowns: int) -> int:
    """Fixes of one frame, by the size of the estimate that each of them updates."""
    return max(LEAST_TAKEN, MOST_MOVED // (unknowns * unknowns))
