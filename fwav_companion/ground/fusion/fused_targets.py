"""A target of the fused picture, and the record of the tracks of each target. Pure."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from fwav_companion.ground.fusion.reported_tracks import Array


@dataclass(slots=True, kw_only=True)
class FusedTarget:
    """One target."""

    id: int
    label: str
    first_unix: float
    seen_unix: float
    """Instant of the newest fix of any of its tracks."""
    members: dict[str, int] = field(default_factory=dict)
    """Track number by vehicle."""
    left_out: dict[str, str] = field(default_factory=dict)
    """Reason by vehicle whose track of this target does not count."""
    position: Array = field(default_factory=lambda: np.zeros(2))
    """North and east, metres."""
    cov: Array = field(default_factory=lambda: np.eye(2))
    """Covariance including every source of error, m^2."""
    down_m: float = 0.0
    down_variance: float = 1.0
    confirmed: bool = False
    """Whether one of its confirmed tracks is fresh."""
    steps_outside_gate: dict[str, int] = field(default_factory=dict)
    """Number of steps in a row in which the track of each vehicle disagreed."""


class TargetBooks:
    """Targets by id, and the target of each track."""

    def __init__(self) -> None:
        self.targets: dict[int, FusedTarget] = {}
        self.of_track: dict[tuple[str, int], int] = {}
        self._next = 1

    def new(self, label: str, now: float) -> FusedTarget:
        """A new target without tracks."""
        target = FusedTarget(id=self._next, label=label, first_unix=now, seen_unix=now)
        self.targets[self._next] = target
        self._next += 1
        return target

    def join(self, target: FusedTarget, vehicle: str, track: int) -> None:
        """Add a track to a target; a vehicle has at most one track of a target."""
        self.leave(vehicle, track)
        target.members[vehicle] = track
        self.of_track[vehicle, track] = target.id

    def leave(self, vehicle: str, track: int) -> None:
        """Remove a track from its target; a target without tracks is deleted."""
        target = self.targets.get(self.of_track.pop((vehicle, track), 0))
        if target is None:
            return
        if target.members.get(vehicle) == track:
            del target.members[vehicle]
        target.steps_outside_gate.pop(vehicle, None)
        if not target.members:
            del self.targets[target.id]

    def renamed(self, rebuilt: TargetBooks) -> TargetBooks:
        """The rebuilt books, in which a target with most tracks of a present target has its id and first instant."""
        common = Counter((at, self.of_track[key]) for key, at in rebuilt.of_track.items() if key in self.of_track)
        own: dict[int, int] = {}
        taken: set[int] = set()
        for (new_id, old_id), _ in common.most_common():
            if new_id not in own and old_id not in taken:
                own[new_id] = old_id
                taken.add(old_id)
        renamed = TargetBooks()
        renamed._next = self._next
        for target in rebuilt.targets.values():
            known = self.targets.get(own.get(target.id, 0))
            copy = renamed.new(target.label, target.first_unix) if known is None else known
            if known is not None:
                known.members, known.steps_outside_gate = {}, {}
                renamed.targets[known.id] = known
            copy.position, copy.cov, copy.seen_unix = target.position, target.cov, target.seen_unix
            for vehicle, track in target.members.items():
                renamed.join(copy, vehicle, track)
        return renamed

    def merge(self, kept: FusedTarget, gone: FusedTarget) -> None:
        """Move all tracks of one target to another."""
        kept.first_unix = min(kept.first_unix, gone.first_unix)
        for vehicle, track in list(gone.members.items()):
            self.join(kept, vehicle, track)
