"""Association of the vehicles' tracks with targets. Pure.

A target keeps its tracks while they agree with it. Numbers from a detector or from another vehicle never identify a
target; tracks with different labels are never associated. A vehicle that is new here is registered as a pattern first;
then each further track is associated with the nearest target within the gate of both covariances.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence

import numpy as np

from fwav_companion.ground.fusion.fused_targets import FusedTarget, TargetBooks
from fwav_companion.ground.fusion.place_index import PlaceIndex, nis
from fwav_companion.ground.fusion.registration import registered
from fwav_companion.ground.fusion.reported_tracks import Array, Indices, ReportedTrack, ReportingVehicle

GATE = 13.82
"""NIS with 2 degrees of freedom that 1 of 1000 true pairs exceeds."""
RELEASE_GATE = 18.42
"""NIS that 1 of 10 000 true pairs exceeds: a track leaves its target after exceeding it for RELEASE_STEPS."""
RELEASE_STEPS = 4
"""Steps in a row beyond RELEASE_GATE after which a track leaves its target."""
MERGE_GATE = 9.21
"""NIS that 1 of 100 true pairs exceeds: within it, two targets without a common vehicle are merged, if each is the
other's nearest."""
SPARE = 8
"""Nearest targets of a track that are considered beyond the number of its vehicle's tracks: these may have taken the
nearest ones."""
NEIGHBOURS = 16
"""Nearest targets with which a target may be merged."""
SHARE = 128
"""Tracks, or targets, after which work in a loop pauses: some milliseconds."""
PATTERN = 2
"""Least number of tracks without a target for which a vehicle is registered as a pattern."""
TOLERANCE_SIGMAS = 3.0


def release(books: TargetBooks, vehicles: Mapping[str, ReportingVehicle], now: float) -> Generator[None]:
    """Remove from the targets the tracks that have ended, or that have disagreed for RELEASE_STEPS.

    It pauses after each SHARE of tracks.
    """
    for number, (key, target_id) in enumerate(list(books.of_track.items())):
        if number % SHARE == SHARE - 1:
            yield
        vehicle = vehicles.get(key[0])
        track = None if vehicle is None else vehicle.tracks.get(key[1])
        if vehicle is None or track is None:
            books.leave(*key)
            continue
        target = books.targets[target_id]
        if len(target.members) < 2:
            continue
        apart = float(nis(vehicle.corrected(track, now) - target.position, vehicle.spread(track) + target.cov))
        steps = target.steps_outside_gate.get(key[0], 0) + 1 if apart > RELEASE_GATE else 0
        target.steps_outside_gate[key[0]] = steps
        if steps >= RELEASE_STEPS:
            books.leave(*key)


def associate(
    books: TargetBooks, vehicle: ReportingVehicle, index: PlaceIndex, now: float, most: int | None = None
) -> int:
    """Associate each confirmed track without a target with an existing target, or initiate a new one.

    ``most``: number of tracks that are associated now; the others wait. Returns the number of those that wait.
    """
    waiting = [track for track in vehicle.tracks.values() if track.confirmed and track.key not in books.of_track]
    left = 0 if most is None else max(0, len(waiting) - most)
    waiting = waiting[: len(waiting) - left]
    if not waiting:
        return left
    positions = np.array([vehicle.corrected(track, now) for track in waiting])  # (n, 2)
    spreads = np.array([vehicle.spread(track) for track in waiting])  # (n, 2, 2)
    rows, near = _near(vehicle, waiting, positions, index)
    shift = np.zeros(2)
    if len(waiting) >= PATTERN and 2 * len(waiting) > len(vehicle.tracks):
        shift = _pattern_shift(waiting, positions, spreads, near)
    taken: set[int] = set()
    for position, target in _gated(positions, spreads, rows=rows, near=near, shift=shift):
        if position in taken or vehicle.name in target.members:
            continue
        taken.add(position)
        books.join(target, vehicle.name, waiting[position].track)
    for position, track in enumerate(waiting):
        if position not in taken:
            target = books.new(track.label, now)
            target.position, target.cov = positions[position], spreads[position]
            books.join(target, vehicle.name, track.track)
            index.add(target)
    return left


def merge_targets(books: TargetBooks) -> Generator[None]:
    """Merge targets with one label and without a common vehicle that are each other's nearest within the gate.

    It pauses after each SHARE of targets.
    """
    index = PlaceIndex(books.targets.values())
    nearest: dict[int, int] = {}
    for label in dict.fromkeys(target.label for target in books.targets.values()):
        of_label = [target for target in books.targets.values() if target.label == label]
        for first in range(0, len(of_label), SHARE):
            own = of_label[first : first + SHARE]
            positions, covs = np.array([each.position for each in own]), np.array([each.cov for each in own])
            rows, others = index.near(label, positions, most=NEIGHBOURS + 1)
            apart = nis(
                positions[rows] - np.array([each.position for each in others]).reshape(-1, 2),
                covs[rows] + np.array([each.cov for each in others]).reshape(-1, 2, 2),
            )
            for pair in np.flatnonzero(apart < MERGE_GATE)[np.argsort(apart[apart < MERGE_GATE], kind="stable")]:
                target, other = own[rows[pair]], others[int(pair)]
                if other is not target and target.members.keys().isdisjoint(other.members):
                    nearest.setdefault(target.id, other.id)
            yield
    for target_id, other_id in nearest.items():
        kept, gone = books.targets.get(target_id), books.targets.get(other_id)
        if kept is None or gone is None or nearest.get(other_id) != target_id or kept.id > gone.id:
            continue
        books.merge(kept, gone)


def _near(
    vehicle: ReportingVehicle, waiting: Sequence[ReportedTrack], positions: Array, index: PlaceIndex
) -> tuple[Indices, list[FusedTarget]]:
    """Index of the track, and target, of each pair of one label within reach; not targets that the vehicle sees."""
    rows: list[Indices] = []
    near: list[FusedTarget] = []
    for label in dict.fromkeys(track.label for track in waiting):
        own = np.array([at for at, track in enumerate(waiting) if track.label == label])
        of_label, found = index.near(label, positions[own], most=len(vehicle.tracks) + SPARE)
        free = [at for at, target in enumerate(found) if vehicle.name not in target.members]
        rows.append(own[of_label[free]])
        near += [found[at] for at in free]
    return np.concatenate(rows), near


def _gated(
    positions: Array, spreads: Array, *, rows: Indices, near: Sequence[FusedTarget], shift: Array
) -> list[tuple[int, FusedTarget]]:
    """Index of the track, and target, of each pair within the gate, the likeliest after the pattern's shift first."""
    if not near:
        return []
    apart = positions[rows] - np.array([target.position for target in near])  # (pairs, 2)
    covs = spreads[rows] + np.array([target.cov for target in near])  # (pairs, 2, 2)
    inside = np.flatnonzero(nis(apart, covs) <= GATE)
    ids = np.array([near[int(at)].id for at in inside], np.intp)
    order = np.lexsort((ids, rows[inside], nis(apart[inside] - shift, covs[inside])))
    return [(int(rows[at]), near[int(at)]) for at in inside[order]]


def _pattern_shift(
    waiting: Sequence[ReportedTrack], positions: Array, spreads: Array, near: Sequence[FusedTarget]
) -> Array:
    """Shift of the vehicle's pattern; zero if it exceeds what the biases allow, or if no two tracks agree on it."""
    others = list({target.id: target for target in near}.values())
    shift = registered(
        positions,
        [track.label for track in waiting],
        np.array([target.position for target in others]).reshape(-1, 2),
        [target.label for target in others],
        tolerance_m=tolerance_m(waiting),
    )
    if shift is None or shift.votes < PATTERN:
        return np.zeros(2)
    row, column = shift.pairs[0]
    return shift.metres if nis(shift.metres, spreads[row] + others[column].cov) <= GATE else np.zeros(2)


def tolerance_m(tracks: Sequence[ReportedTrack]) -> float:
    """Largest difference of the shifts of two tracks of one vehicle, metres, by the noise of both."""
    mean = float(np.mean([0.5 * np.trace(track.noise) for track in tracks]))
    return max(1.0, TOLERANCE_SIGMAS * float(np.sqrt(2.0 * mean)))
