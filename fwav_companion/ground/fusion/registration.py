"""Registration: the shift of a vehicle's pattern of targets against the targets that others see. Pure.

Every pair of a track and a target with its label votes for the shift between them. The shift on which most tracks agree
is the vehicle's. A nearest neighbour would be wrong if the targets are as close together as the shift is long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fwav_companion.ground.fusion.reported_tracks import Array

REACH_M = 40.0
"""Longest shift of the search, metres: several times the worst error of a receiver that still reports a 3D fix."""
MAX_PAIRS = 400
"""Most pairs that vote; if there are more, those with the shortest shifts vote."""


@dataclass(slots=True)
class Shift:
    """The shift of one vehicle."""

    metres: Array
    """North and east of the shift, metres: the vehicle's places minus the others'."""
    pairs: list[tuple[int, int]]
    """Indices of track and target that agree on it."""

    @property
    def votes(self) -> int:
        """Number of tracks that agree."""
        return len(self.pairs)


def registered(
    positions: Array, labels: Sequence[str], places: Array, place_labels: Sequence[str], *, tolerance_m: float
) -> Shift | None:
    """The shift with the most votes, and the shortest of equal ones; None if no pair is within reach."""
    if not len(positions) or not len(places):
        return None
    shifts = positions[:, None, :] - places[None, :, :]
    lengths = np.hypot(shifts[..., 0], shifts[..., 1])
    codes = {label: code for code, label in enumerate(dict.fromkeys((*labels, *place_labels)))}
    own, other = (np.array([codes[label] for label in each]) for each in (labels, place_labels))
    same = own[:, None] == other[None, :]
    tracks, targets = np.nonzero(same & (lengths <= REACH_M))
    if not len(tracks):
        return None
    order = np.argsort(lengths[tracks, targets], kind="stable")[:MAX_PAIRS]
    tracks, targets = tracks[order], targets[order]
    found = shifts[tracks, targets]
    close = np.hypot(*(found[:, None, :] - found[None, :, :]).transpose(2, 0, 1)) <= tolerance_m
    votes = [len(set(tracks[row].tolist())) for row in close]
    best = int(np.argmax(votes))  # the first of equals is the shortest
    pairs = _one_to_one(tracks[close[best]], targets[close[best]], found[close[best]], found[best])
    metres = np.mean([shifts[track, target] for track, target in pairs], axis=0)
    return Shift(metres, pairs)


def _one_to_one(tracks: Array, targets: Array, found: Array, centre: Array) -> list[tuple[int, int]]:
    """Pairs in which each track and each target occurs once, those nearest to the shift first."""
    order = np.argsort(np.hypot(*(found - centre).T), kind="stable")
    taken_tracks: set[int] = set()
    taken_targets: set[int] = set()
    pairs = []
    for index in order:
        track, target = int(tracks[index]), int(targets[index])
        if track not in taken_tracks and target not in taken_targets:
            taken_tracks.add(track)
            taken_targets.add(target)
            pairs.append((track, target))
    return pairs
