"""The bounded set of sightings that every solve linearises again, and how it is thinned.

Sums of information of old sightings were tried: each was linearised at the calibration of its time, and adding sums of
different linearisation points creates information in directions that no sighting observes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fwav_companion.estimation.errors import Array, Bools, Ints

KEPT = 400  # of a live solve; 600 gain nothing that shows, 300 with one iteration lose
KEPT_OF_WHOLE_FLIGHT = 4000  # of the final answer in replay
KEPT_OF_FRAME = 100  # of one frame: a detector that reports a thousand must not displace the flight
LEADING = 5  # targets that are kept in many frames
_OF_LEADING = 0.625  # share of the budget that is theirs, where there are others
_DENSE_S = 4.0  # age up to which the step between kept frames stays nearly the same
_CELLS = 60.0


@dataclass(frozen=True)
class Sightings:
    """N detections in order of time, the last axis of every array."""

    t: Array  # (N,) s, as stamped
    rays: Array  # (3, N) unit directions in carrier axes by the configured mount
    tangents: Array  # (2, 3, N) standardised units (noise of one) for a direction across the ray
    frame: Ints  # (N,) one number a frame, growing
    target: Ints  # (N,) -1: none
    row: Array  # (N,) share of the readout at which the row was exposed; 0: a global shutter
    # (3, N) what the frame's own pose adds to the noise: attitude rad, position m, height m. None: nothing
    own_noise: Array | None = None

    def __len__(self) -> int:
        return len(self.t)

    def select(self, which: Bools | Ints) -> Sightings:
        """Those of a mask (N,) or of indices."""
        if which.dtype == np.bool_ and bool(which.all()):
            return self
        i = np.flatnonzero(which) if which.dtype == np.bool_ else which
        own = None if self.own_noise is None else self.own_noise.take(i, -1)
        return Sightings(
            self.t[i], self.rays.take(i, -1), self.tangents.take(i, -1), self.frame[i], self.target[i], self.row[i], own
        )

    def with_targets(self, target: Ints) -> Sightings:
        """The same detections, of other targets."""
        return replace(self, target=target)


def frame_of(number: int, t: Array, rays: Array, tangents: Array) -> Sightings:
    """A frame's detections, without targets; those that are not finite are left out, and those beyond the bound."""
    finite = np.isfinite(t) & np.isfinite(rays).all(0) & np.isfinite(tangents).all((0, 1))
    finite &= np.abs((rays * rays).sum(0) - 1.0) < 1e-3
    index = np.flatnonzero(finite)
    if len(index) > KEPT_OF_FRAME:
        index = index[np.linspace(0, len(index) - 1, KEPT_OF_FRAME).astype(np.int64)]
    none = np.full(len(t), -1, np.int64)
    return Sightings(t, rays, tangents, np.full(len(t), number, np.int64), none, np.zeros(len(t))).select(index)


def joined(parts: Sequence[Sightings]) -> Sightings:
    """One set of several that follow each other."""
    if len(parts) == 1:
        return parts[0]
    return Sightings(
        np.concatenate([p.t for p in parts]),
        np.concatenate([p.rays for p in parts], -1),
        np.concatenate([p.tangents for p in parts], -1),
        np.concatenate([p.frame for p in parts]),
        np.concatenate([p.target for p in parts]),
        np.concatenate([p.row for p in parts]),
        _joined_noise(parts),
    )


def _joined_noise(parts: Sequence[Sightings]) -> Array | None:
    if all(p.own_noise is None for p in parts):
        return None
    return np.concatenate([np.zeros((3, len(p))) if p.own_noise is None else p.own_noise for p in parts], -1)


def in_order(s: Sightings) -> Sightings:
    """In order of frames: the first sightings of a target come when it is confirmed, after later frames' others."""
    return s if bool((s.frame[1:] >= s.frame[:-1]).all()) else s.select(np.argsort(s.frame, kind="stable"))


def best_seen(s: Sightings, most: int) -> Sightings:
    """The sightings of the targets that are seen most often, at most this many."""
    ids, count = np.unique(s.target, return_counts=True)
    if len(ids) <= most:
        return s
    best: Ints = ids[np.argsort(-count, kind="stable")[:most]]
    return s.select(np.isin(s.target, best))


def thinned(s: Sightings, now: float, budget: int = KEPT) -> Sightings:
    """At most about `budget` sightings: the targets that are seen most in many frames, the others in fewer.

    Few targets in many frames show more of the shared parameters than many targets in few: of 30 targets whole frames
    are 13 in a minute, and places were wrong by 0.15 m where 0.09 to 0.12 is possible.
    """
    if len(s) <= budget:
        return s
    ids, of_target = np.unique(s.target, return_inverse=True)
    if len(ids) <= LEADING:
        return _thinned_frames(s, now, budget)
    # By age, as frames are kept: above the next field the targets in view take over.
    seen = np.bincount(of_target, 1.0 / (np.maximum(now - s.t, 0.0) + _DENSE_S))
    leads = np.isin(s.target, ids[np.argsort(-seen, kind="stable")[:LEADING]])
    leading = _thinned_frames(s.select(leads), now, int(_OF_LEADING * budget))
    others = _thinned_frames(s.select(~leads), now, budget - len(leading))
    return in_order(joined([leading, others]))


def _thinned_frames(s: Sightings, now: float, budget: int) -> Sightings:
    """At most about `budget` sightings in whole frames: all of the newest, older ones in growing steps.

    The step between kept frames is c (age + 4 s) / 60, c by bisection. Steps and not a random choice: what counts is
    the spread over the flight's geometry. The newest are dense because they carry the vehicle's error now.
    """
    if len(s) <= budget:
        return s
    _, first, count = np.unique(s.frame, return_index=True, return_counts=True)
    depth = np.log1p(np.maximum(now - s.t[first], 0.0) / _DENSE_S) * _CELLS
    low, high = 0.0, 64.0
    for _ in range(14):
        c = 0.5 * (low + high)
        low, high = (c, high) if count[_opens_cell(depth, c)].sum() > budget else (low, c)
    return s.select(np.repeat(_opens_cell(depth, high), count))


def _opens_cell(depth: Array, width: float) -> Bools:
    """Mask of the frames, in order of time, that are the first of a cell of this width."""
    cell = np.floor(depth / max(width, 1e-6))
    return np.concatenate([[True], cell[1:] != cell[:-1]])


def spread(s: Sightings, most: int, since: float) -> Sightings:
    """About `most` sightings in whole frames, evenly over those after `since`."""
    recent = s.t > since
    if int(recent.sum()) > 20:
        s = s.select(recent)
    if len(s) <= most:
        return s
    frames = np.unique(s.frame)
    count = max(4, int(most * len(frames) / len(s)))
    chosen = frames[np.unique(np.linspace(0, len(frames) - 1, count).astype(np.int64))]
    return s.select(np.isin(s.frame, chosen))
