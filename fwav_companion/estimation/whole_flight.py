"""The sightings of a whole flight, spread evenly over it: for the smoothed answer at its end, in a replay."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fwav_companion.estimation.errors import Array
from fwav_companion.estimation.kept_sightings import KEPT_OF_WHOLE_FLIGHT, Sightings, in_order, joined

MOST_TARGETS = 64
MOST_KNOTS = 120
_LEAST_GAP_S = 0.5


class WholeFlight:
    """Whole frames, every one at first; each time that they are too many, every second one goes."""

    def __init__(self, most: int = KEPT_OF_WHOLE_FLIGHT) -> None:
        """most: sightings kept."""
        self._most = most
        self._frames: list[Sightings] = []
        self._stride, self._arrived, self._count = 1, 0, 0

    def add(self, frame: Sightings) -> None:
        """Take a frame's sightings; all have targets."""
        self._arrived += 1
        if (self._arrived - 1) % self._stride:
            return
        self._frames.append(frame)
        self._count += len(frame)
        while self._count > self._most and len(self._frames) > 1:
            del self._frames[1::2]
            self._stride *= 2
            self._count = sum(len(each) for each in self._frames)

    def copy(self) -> WholeFlight:
        """A snapshot."""
        other = WholeFlight(self._most)
        other._frames = list(self._frames)
        other._stride, other._arrived, other._count = self._stride, self._arrived, self._count
        return other

    def times(self) -> Array:
        """Instants (F,) of the frames kept."""
        return np.array([frame.t[0] for frame in self._frames])

    def rename(self, old: int, new: int) -> None:
        """Count the sightings of a target as those of another: they were found to be one."""
        self._frames = [
            s.with_targets(np.where(s.target == old, new, s.target)) if old in s.target else s for s in self._frames
        ]

    def forget(self, target: int) -> None:
        """Leave out a target's sightings."""
        frames = [s.select(s.target != target) if target in s.target else s for s in self._frames]
        self._frames = [s for s in frames if len(s)]
        self._count = sum(len(s) for s in self._frames)

    def sightings(self, since: float) -> Sightings | None:
        """Those after the instant `since`, in order, of the targets that are seen most; None without one."""
        if not self._frames:
            return None
        s = in_order(joined(self._frames))
        s = s.select(s.t > since)
        if not len(s):
            return None
        ids, count = np.unique(s.target, return_counts=True)
        if len(ids) <= MOST_TARGETS:
            return s
        return s.select(np.isin(s.target, ids[np.argsort(-count, kind="stable")[:MOST_TARGETS]]))


def even_knots(t: Array, end: float, inside: Sequence[float]) -> Array:
    """Times (K,) of knots about sightings (N,) s, equally dense over the flight, at most about 120; at breaks, too."""
    gap = _LEAST_GAP_S
    while True:
        cells = np.unique(np.floor(t / gap))
        knots = np.unique(np.concatenate([cells, cells + 1.0])) * gap
        if len(knots) <= MOST_KNOTS:
            break
        gap *= 2.0
    breaks = [x for x in inside if t[0] < x < end]
    return np.unique(np.round(np.concatenate([knots[knots < end], [min(float(t[0]), end - gap), end], breaks]), 6))
