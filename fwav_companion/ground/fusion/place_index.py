"""Index of targets by label and place: a k-d tree a label (scipy). Pure.

Dense targets, such as a crowd that every vehicle sees, must not cost more than their number: a query is bounded.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import numpy as np
from scipy.spatial import cKDTree

from fwav_companion.ground.fusion.fused_targets import FusedTarget
from fwav_companion.ground.fusion.reported_tracks import Array, Indices

REACH_M = 35.0
"""Reach of a query, metres: wider than the gates of receivers that report a 3D fix."""
FRESH = 64
"""Targets that were added since the tree was made, from which it is made again."""


class _Places:
    """Targets of one label."""

    def __init__(self) -> None:
        self.targets: list[FusedTarget] = []
        self._tree: cKDTree | None = None
        self._in_tree = 0

    def add(self, target: FusedTarget) -> None:
        """Add a target at its position."""
        self.targets.append(target)

    def near(self, positions: Array, reach_m: float, most: int) -> tuple[Indices, Indices]:
        """Indices of position and target of each pair within reach, at most ``most`` and FRESH for each position."""
        if len(self.targets) - self._in_tree > FRESH or (self._tree is None and len(self.targets) > FRESH):
            self._tree = cKDTree(np.array([target.position for target in self.targets]))
            self._in_tree = len(self.targets)
        rows, found = np.zeros(0, np.intp), np.zeros(0, np.intp)
        if self._tree is not None:
            count = min(most, self._in_tree)
            _, places = self._tree.query(positions, k=range(1, count + 1), distance_upper_bound=reach_m)
            rows, columns = np.nonzero(places < self._in_tree)
            found = places[rows, columns]
        fresh = np.array([target.position for target in self.targets[self._in_tree :]]).reshape(-1, 2)
        apart = positions[:, None, :] - fresh[None, :, :]  # (positions, fresh, 2)
        more, columns = np.nonzero(np.hypot(apart[..., 0], apart[..., 1]) <= reach_m)
        return np.concatenate([rows, more]), np.concatenate([found, columns + self._in_tree])


class PlaceIndex:
    """Targets by label and place."""

    def __init__(self, targets: Iterable[FusedTarget]) -> None:
        self._places: dict[str, _Places] = defaultdict(_Places)
        for target in targets:
            self.add(target)

    def add(self, target: FusedTarget) -> None:
        """Add a target at its position."""
        self._places[target.label].add(target)

    def near(
        self, label: str, positions: Array, *, most: int, reach_m: float = REACH_M
    ) -> tuple[Indices, list[FusedTarget]]:
        """Index of the position, and target, of each pair of this label within reach.

        ``positions``: (n, 2), metres. ``most``: number of nearest targets of each position that are considered.
        """
        places = self._places.get(label)
        if places is None or not len(positions):
            return np.zeros(0, np.intp), []
        rows, found = places.near(positions, reach_m, most)
        return rows, [places.targets[index] for index in found]


def nis(differences: Array, covs: Array) -> Array:
    """Normalised squares of differences, 2 degrees of freedom: (n,) of (n, 2) and (n, 2, 2)."""
    a, b, d = covs[..., 0, 0], covs[..., 0, 1], covs[..., 1, 1]
    x, y = differences[..., 0], differences[..., 1]
    squares: Array = (d * x * x - 2.0 * b * x * y + a * y * y) / (a * d - b * b)
    return squares
