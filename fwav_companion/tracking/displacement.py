"""Fixes displaced by a camera error beyond its prior: they are not evidence of another target.

A camera delay beyond its prior displaces fixes by more than the gate. The fixes of one target then alternate between
its track and a new one. Such an error displaces all targets of a frame by about the same distance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import dist, hypot

import msgspec

from fwav_companion.geometry.vectors import subtract
from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.track_state import LiveTrack
from fwav_companion.types import GroundFix

DISPLACED_SIGMAS = 8.0
"""Largest displacement, sigmas: twice the gate. A camera late by three sigma displaces a fix by that distance."""
OFF_RATIO = 2.0
"""Largest ratio of two displacements in a frame. An angle displaces a fix in proportion to the square of the range over
the height: twice as far at 45 degrees as below the vehicle."""


class Absent(msgspec.Struct, frozen=True):
    """Confirmed tracks that a frame missed."""

    tracks: Sequence[LiveTrack]
    seen_off_m: float | None
    """Least distance of a fix from its own confirmed track in this frame, metres; None without such a fix."""

    def may_explain(self, fix: GroundFix) -> bool:
        """Whether the fix may be a displaced fix of one of these tracks."""
        label = fix.sighting.detection.label
        return any(_may_be_displaced(each.target, fix, self.seen_off_m) for each in self.tracks if each.label == label)


NONE_ABSENT = Absent((), None)
"""A frame that missed no track."""


def absent(
    tracks: Sequence[LiveTrack],
    missed: Sequence[LiveTrack],
    taken: Mapping[int, tuple[GroundFix, float]],
    *,
    photographs: bool,
) -> Absent:
    """The confirmed tracks that a frame missed. ``taken``: fixes assigned to tracks, by track id.

    Displacements are compared only in ``photographs``: among many frames, some show a displaced target in the place of
    another target.
    """
    confirmed = [track for track in missed if track.confirmed]
    if not (confirmed and photographs):
        return Absent(confirmed, None)
    seen = [track for track in tracks if track.confirmed and track.id in taken]
    off_m = [dist(taken[track.id][0].position_ned[:2], track.target.apparent_ned[:2]) for track in seen]
    return Absent(confirmed, min(off_m, default=None))


def _may_be_displaced(target: TargetState, fix: GroundFix, seen_off_m: float | None) -> bool:
    """Whether a fix lies within DISPLACED_SIGMAS of a target on both axes, without the vehicle's position errors.

    It must also be at most OFF_RATIO times as far from the target as ``seen_off_m``, the least distance of another fix
    from its own target.
    """
    own, other, reach2 = target.relative_cov, fix.relative_cov, DISPLACED_SIGMAS**2
    north, east, _ = subtract(fix.position_ned, target.apparent_ned)
    if seen_off_m is not None and hypot(north, east) > OFF_RATIO * seen_off_m:
        return False
    return north * north <= reach2 * (own[0][0] + other[0][0]) and east * east <= reach2 * (own[1][1] + other[1][1])
