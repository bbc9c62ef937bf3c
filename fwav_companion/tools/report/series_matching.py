"""Assignment of tracks to targets: lines to targets, targets to truths, targets of one variant to those of another.

Pure.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import hypot

import msgspec

from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.recording.labels import display_names
from fwav_companion.recording.line_types import Line, TargetLine
from fwav_companion.tracking.assignment import least_cost_assignment
from fwav_companion.types import TrackState

FORBIDDEN_M = 1e9
"""Assignment cost of a forbidden pair, metres: larger than any distance on Earth."""
MOST_MATCHED = 60
"""Most rows of one assignment: its run time grows with the cube of the rows."""
OWN_RADII = 3.0
"""Largest distance of a target from its own truth where several truths fit its label, in claimed 95 % radii."""


class GroupedLines(msgspec.Struct, frozen=True):
    """The target lines of one target."""

    label: str
    """The detector's label."""
    name: str
    """Unique name for people; it has the track's number where several targets share the label."""
    shares_label: bool
    """Whether several targets have this label."""
    lines: list[TargetLine]

    @property
    def confirmed(self) -> list[TargetLine]:
        """The lines in which the target is confirmed or coasting."""
        return [line for line in self.lines if line.is_confirmed]

    @property
    def shown(self) -> list[TargetLine]:
        """The lines to draw: the confirmed ones, or every line of a target that was never confirmed."""
        return self.confirmed or [line for line in self.lines if line.state is not TrackState.DROPPED]


def targets_of(lines: Iterable[Line]) -> list[GroupedLines]:
    """The targets of a recording: one per label, or one per track where tracks of a label are confirmed together."""
    by_label: dict[str, list[TargetLine]] = {}
    for line in lines:
        if isinstance(line, TargetLine):
            by_label.setdefault(line.label, []).append(line)
    names = display_names(by_label)
    found = []
    for label, own in by_label.items():
        if not _confirmed_together(own):
            found.append(GroupedLines(label, names[label], False, own))
            continue
        by_track: dict[int, list[TargetLine]] = {}
        for line in own:
            by_track.setdefault(line.track, []).append(line)
        tracks = [GroupedLines(label, f"{names[label]} #{track}", True, each) for track, each in by_track.items()]
        found += [each for each in tracks if each.confirmed]
    return found


def _confirmed_together(lines: Sequence[TargetLine]) -> bool:
    """Whether two tracks were confirmed at the same time."""
    track_at: dict[float, int] = {}
    confirmed = (line for line in lines if line.is_confirmed)
    return any(track_at.setdefault(line.time_unix, line.track) != line.track for line in confirmed)


def assigned(distances_m: Sequence[Sequence[float | None]]) -> list[int | None]:
    """The column of each row, each column at most once, with the least sum of distances; None for a row left over.

    An error that is common to all targets (GNSS, mount) may bring a track closer to its neighbour's truth than to its
    own, but it does not change the order of the sums. A distance None forbids the pair.
    """
    found: list[int | None] = [None] * len(distances_m)
    rows = range(min(len(distances_m), MOST_MATCHED))
    if not rows:
        return found
    costs = [
        {-1 - row: FORBIDDEN_M} | {column: cost for column, cost in enumerate(distances_m[row]) if cost is not None}
        for row in rows
    ]  # a column of its own for each row, so that each may stay unassigned
    for row, column in zip(rows, least_cost_assignment(costs), strict=True):
        if column >= 0:
            found[row] = column
    _assign_rest(found, distances_m)
    return found


def _assign_rest(found: list[int | None], distances_m: Sequence[Sequence[float | None]]) -> None:
    """Assign the rows beyond MOST_MATCHED to the columns that are left, the shortest distance first."""
    free = set(range(len(distances_m[0]))).difference(found)
    candidates = sorted(
        (distance_m, row, column)
        for row in range(MOST_MATCHED, len(distances_m))
        for column in free
        if (distance_m := distances_m[row][column]) is not None
    )
    for _, row, column in candidates:
        if found[row] is None and column in free:
            found[row] = column
            free.remove(column)


def own_columns(targets: Sequence[GroupedLines], distances_m: Sequence[Sequence[float | None]]) -> list[int | None]:
    """The column of each target's own truth; None for a target that is left over, or too far where several fit.

    A common error (GNSS) moves all targets of a label, so the limit grows with the distance of the nearest one.
    """
    columns = assigned(distances_m)
    nearest_m: dict[str, float] = {}
    for target, row, column in zip(targets, distances_m, columns, strict=True):
        if column is not None:
            distance_m = row[column] or 0.0
            nearest_m[target.label] = min(distance_m, nearest_m.get(target.label, distance_m))

    def is_near(target: GroupedLines, row: Sequence[float | None], column: int) -> bool:
        if not target.shares_label and sum(each is not None for each in row) == 1:
            return True
        claimed_m = circle_radius(target.shown[-1].cov, 0.95)
        return (row[column] or 0.0) <= OWN_RADII * max(claimed_m, nearest_m[target.label])

    return [
        column if column is not None and is_near(target, row, column) else None
        for target, row, column in zip(targets, distances_m, columns, strict=True)
    ]


def final_distances_m(ours: Sequence[GroupedLines], theirs: Sequence[GroupedLines]) -> list[list[float | None]]:
    """Distances between the final estimates of two variants, metres; None for a pair that is not the same target.

    Where several targets share a label, estimates from the same sightings are at most about twice the sum of their
    95 % radii apart.
    """
    radii = [[circle_radius(each.confirmed[-1].cov, 0.95) for each in targets] for targets in (ours, theirs)]
    table: list[list[float | None]] = []
    for our, our_radius_m in zip(ours, radii[0], strict=True):
        our_end, distances = our.confirmed[-1], list[float | None]()
        for their, their_radius_m in zip(theirs, radii[1], strict=True):
            their_end = their.confirmed[-1]
            distance_m = hypot(their_end.north - our_end.north, their_end.east - our_end.east)
            near = distance_m <= 2.0 * (our_radius_m + their_radius_m)
            same = our.label == their.label and (near or not (our.shares_label or their.shares_label))
            distances.append(distance_m if same else None)
        table.append(distances)
    return table
