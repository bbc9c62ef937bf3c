"""Association of kept measurements with targets once the delay is known.

Before that, a camera that is late by 35 ms displaces its measurements by more than a metre, and targets 3 m apart
exchange their fixes. With an estimate of the delay, the places of the targets decide: a measurement belongs to the
target whose predicted pixel is nearest.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.filter_pass import WORST, FilterPass
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT, distances

NEARER = 0.5
"""Ratio of a measurement's distance from another target to its distance from its own, below which it changes to the
other. Errors that all targets share move them by less than half of their separation, or they cannot be separated."""

NEAR = 0.3
"""Distance of two targets over the camera's height, from which their measurements are not exchanged: flapping of
5 degrees, late by a quarter of a beat, displaces measurements by 0.1 of the height, and a wrong mount moves both."""


class Trial(msgspec.Struct, frozen=True):
    """One hypothesis of the delay, with its own association of measurements with targets."""

    estimate: FilterPass
    places: dict[int, Array]
    """Apparent place (2) under this hypothesis of each target that has another one near to it, by track."""

    def fed(self, batch: MeasurementBatch, kinds: Mapping[int, str]) -> Trial:
        """The trial after one more batch. ``kinds``: label of each target.

        A measurement that loses its target is charged as the worst, so that a trial gains nothing by it.
        """
        point = self.estimate.joint.linearization_point[0, :SHARED_COUNT]
        associated = reassociated(batch, point, self.places, kinds)
        after, lost = self.estimate.fed(associated), len(batch.tracks) - len(associated.tracks)
        if lost:
            charge = 0.5 * WORST + float(np.log(batch.pixel_sigma.prod(1)).mean())
            after = msgspec.structs.replace(after, score=after.score - lost * charge, refused=after.refused + lost)
        return Trial(after, self.places)

    def without(self, tracks: Collection[int]) -> Trial:
        """The trial without some targets."""
        places = {track: place for track, place in self.places.items() if track not in tracks}
        return Trial(self.estimate.without(tracks), places)


def near_places(places: Mapping[int, Array], kinds: Mapping[int, str], height_m: float) -> dict[int, Array]:
    """The places of the targets that have another target of the same kind near to them, by track."""
    near: set[int] = set()
    for one, other in combinations(sorted(places), 2):
        if kinds.get(one) == kinds.get(other) and np.hypot(*(places[one] - places[other])) < NEAR * height_m:
            near |= {one, other}
    return {track: places[track] for track in sorted(near)}


def reassociated(
    batch: MeasurementBatch, point: Array, places: Mapping[int, Array], kinds: Mapping[int, str]
) -> MeasurementBatch:
    """The batch with each measurement associated with the clearly nearest target. Of two that one target has in a
    frame, the nearer one is kept.

    ``point``: shared parameters (11). ``places``: apparent place (2) of each target. ``kinds``: label of each target.
    """
    tracks = sorted(places)
    if len(tracks) < 2 or not any(track in places for track in batch.tracks):
        return batch
    apart = distances(batch, np.array([places[track] for track in tracks]), point)
    chosen = _chosen(batch.tracks, tracks, apart, kinds)
    if tuple(chosen) == batch.tracks:
        return batch
    nearest: dict[tuple[float, int], tuple[float, int]] = {}
    for n, track in enumerate(chosen):
        off = float(apart[tracks.index(track), n]) if track in places else 0.0
        key = (int(batch.frame[n]), track)
        nearest[key] = min(nearest.get(key, (off, n)), (off, n))
    kept = sorted(n for _, n in nearest.values())
    return _with_tracks(batch.take(kept), [chosen[n] for n in kept])


def _chosen(own: Sequence[int], tracks: list[int], apart: Array, kinds: Mapping[int, str]) -> list[int]:
    """The track of each measurement; ``own``: its track by the tracker; ``apart`` (T, N): pixels from each target."""
    known, n = np.array([tracks.index(track) if track in tracks else -1 for track in own]), np.arange(len(own))
    if len(set(map(kinds.get, tracks))) > 1:
        labels = np.array([kinds.get(track, "") for track in (*tracks, *own)])
        apart = np.where(labels[: len(tracks), None] == labels[len(tracks) :], apart, np.inf)
    best = apart.argmin(0)
    changed = (known >= 0) & (apart[best, n] < NEARER * apart[known, n])
    return [tracks[k] if change else track for track, k, change in zip(own, best, changed.tolist(), strict=True)]


def _with_tracks(batch: MeasurementBatch, tracks: list[int]) -> MeasurementBatch:
    """The batch with these tracks, sorted by frame and track."""
    order = sorted(range(len(tracks)), key=lambda n: (int(batch.frame[n]), tracks[n]))
    return msgspec.structs.replace(batch.take(order), tracks=tuple(tracks[n] for n in order))
