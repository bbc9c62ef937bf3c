"""Association of the vehicles' tracks with targets. Pure.

A target keeps its tracks while they agree with it. Numbers from a detector or from another vehicle never identify a
target; tracks with different labels are never associated. A vehicle that is new here is registered as a pattern first;
then each further track is associated with the nearest target within the gate of both covariances.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from fwav_companion.ground.fusion.fused_targets import FusedTarget, TargetBooks
from fwav_companion.ground.fusion.registration import registered
from fwav_companion.ground.fusion.reported_tracks import Array, ReportedTrack, ReportingVehicle

GATE = 13.82
"""NIS with 2 degrees of freedom that 1 of 1000 true pairs exceeds."""
RELEASE_GATE = 18.42
"""NIS that 1 of 10 000 true pairs exceeds: a track leaves its target after exceeding it for RELEASE_STEPS."""
RELEASE_STEPS = 4
"""Steps in a row beyond RELEASE_GATE after which a track leaves its target."""
MERGE_GATE = 9.21
"""NIS that 1 of 100 true pairs exceeds: within it, two targets without a common vehicle are merged, if each is the
other's nearest."""
CELL_M = 25.0
"""Side of a cell in the index of places, metres; a gate is not wider."""
PATTERN = 2
"""Least number of tracks without a target for which a vehicle is registered as a pattern."""
TOLERANCE_SIGMAS = 3.0


class PlaceIndex:
    """Targets by cell and label."""

    def __init__(self, targets: Iterable[FusedTarget]) -> None:
        self._cells: dict[tuple[str, int, int], list[FusedTarget]] = defaultdict(list)
        for target in targets:
            self.add(target)

    def add(self, target: FusedTarget) -> None:
        """Add a target at its position."""
        self._cells[self._cell(target.label, target.position)].append(target)

    def near(self, label: str, position: Array, cells: int = 1) -> list[FusedTarget]:
        """Targets of this label within ``cells`` cells."""
        _, row, column = self._cell(label, position)
        around = range(-cells, cells + 1)
        found: list[FusedTarget] = []
        for north in around:
            for east in around:
                found += self._cells.get((label, row + north, column + east), ())
        return found

    @staticmethod
    def _cell(label: str, position: Array) -> tuple[str, int, int]:
        return (label, int(position[0] // CELL_M), int(position[1] // CELL_M))


def nis(difference: Array, cov: Array) -> float:
    """Normalised square of a difference, 2 degrees of freedom."""
    (a, b), (_, d) = cov
    determinant = a * d - b * b
    x, y = difference
    return float((d * x * x - 2.0 * b * x * y + a * y * y) / determinant)


def release(books: TargetBooks, vehicles: dict[str, ReportingVehicle], now: float) -> None:
    """Remove from the targets the tracks that have ended, or that have disagreed for RELEASE_STEPS."""
    for key, target_id in list(books.of_track.items()):
        vehicle = vehicles.get(key[0])
        track = None if vehicle is None else vehicle.tracks.get(key[1])
        if vehicle is None or track is None:
            books.leave(*key)
            continue
        target = books.targets[target_id]
        if len(target.members) < 2:
            continue
        apart = nis(vehicle.corrected(track, now) - target.position, vehicle.spread(track) + target.cov)
        steps = target.apart.get(key[0], 0) + 1 if apart > RELEASE_GATE else 0
        target.apart[key[0]] = steps
        if steps >= RELEASE_STEPS:
            books.leave(*key)


def associate(books: TargetBooks, vehicle: ReportingVehicle, index: PlaceIndex, now: float) -> None:
    """Associate each confirmed track without a target with an existing target, or initiate a new one."""
    waiting = [track for track in vehicle.tracks.values() if track.confirmed and track.key not in books.of_track]
    if not waiting:
        return
    shift = np.zeros(2)
    if len(waiting) >= PATTERN and 2 * len(waiting) > len(vehicle.tracks):
        shift = _pattern_shift(vehicle, waiting, index, now)
    pairs = sorted(
        (
            (apart, position, target.id)
            for position, track in enumerate(waiting)
            for apart, target in _candidates(vehicle, track, index, shift=shift, now=now)
        ),
    )
    taken: set[int] = set()
    for _, position, target_id in pairs:
        track, target = waiting[position], books.targets.get(target_id)
        if position in taken or target is None or vehicle.name in target.members:
            continue
        taken.add(position)
        books.join(target, vehicle.name, track.track)
    for position, track in enumerate(waiting):
        if position not in taken:
            target = books.new(track.label, now)
            target.position, target.cov = vehicle.corrected(track, now), vehicle.spread(track)
            books.join(target, vehicle.name, track.track)
            index.add(target)


def merge_targets(books: TargetBooks) -> None:
    """Merge targets with one label and without a common vehicle that are each other's nearest within the gate."""
    index = PlaceIndex(books.targets.values())
    nearest: dict[int, int] = {}
    for target in books.targets.values():
        best = MERGE_GATE
        for other in index.near(target.label, target.position):
            if other is target or not target.members.keys().isdisjoint(other.members):
                continue
            apart = nis(target.position - other.position, target.cov + other.cov)
            if apart < best:
                best, nearest[target.id] = apart, other.id
    for target_id, other_id in nearest.items():
        kept, gone = books.targets.get(target_id), books.targets.get(other_id)
        if kept is None or gone is None or nearest.get(other_id) != target_id or kept.id > gone.id:
            continue
        books.merge(kept, gone)


def _candidates(
    vehicle: ReportingVehicle, track: ReportedTrack, index: PlaceIndex, *, shift: Array, now: float
) -> list[tuple[float, FusedTarget]]:
    """Targets within the gate, with their distance from the track's place after the pattern's shift."""
    position, spread = vehicle.corrected(track, now), vehicle.spread(track)
    found = []
    for target in index.near(track.label, position):
        if vehicle.name in target.members:
            continue
        cov = spread + target.cov
        if nis(position - target.position, cov) <= GATE:
            found.append((nis(position - shift - target.position, cov), target))
    return found


def _pattern_shift(vehicle: ReportingVehicle, waiting: Sequence[ReportedTrack], index: PlaceIndex, now: float) -> Array:
    """Shift of the vehicle's pattern; zero if it exceeds what the biases allow, or if no two tracks agree on it."""
    near: dict[int, FusedTarget] = {}
    for track in waiting:
        for target in index.near(track.label, vehicle.corrected(track, now)):
            if vehicle.name not in target.members:
                near[target.id] = target
    others = list(near.values())
    shift = registered(
        np.array([vehicle.corrected(track, now) for track in waiting]),
        [track.label for track in waiting],
        np.array([target.position for target in others]).reshape(-1, 2),
        [target.label for target in others],
        tolerance_m=tolerance_m(waiting),
    )
    if shift is None or shift.votes < PATTERN:
        return np.zeros(2)
    target = others[shift.pairs[0][1]]
    spread = vehicle.spread(waiting[shift.pairs[0][0]]) + target.cov
    return shift.metres if nis(shift.metres, spread) <= GATE else np.zeros(2)


def tolerance_m(tracks: Sequence[ReportedTrack]) -> float:
    """Largest difference of the shifts of two tracks of one vehicle, metres, by the noise of both."""
    mean = float(np.mean([0.5 * np.trace(track.noise) for track in tracks]))
    return max(1.0, TOLERANCE_SIGMAS * float(np.sqrt(2.0 * mean)))
