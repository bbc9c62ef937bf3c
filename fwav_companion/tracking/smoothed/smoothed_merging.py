"""Merging of two tracks of one target: places that differ by less than three sigmas of their difference.

The errors that both share cancel in the difference, and no frame may have shown both. Checked when a solve is taken
over: it is what moves targets that were seen from different sides onto one place.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist

from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.target_pairs import separation2
from fwav_companion.tracking.smoothed.smoothed_track import SmoothedTrack
from fwav_companion.types import TrackState

SEPARATION2 = 9.0
"""Squared distance of two places, by the covariance of their difference, below which they are one target's."""
NEAR_NOISE2 = 4.0
"""Squared distance, and variance of the difference, in variances of one fix's noise, above which a difference is too
large, or too uncertain, to say so: two targets beyond each other's noise stay two until they are known better."""


def merged(tracks: Sequence[SmoothedTrack], estimator: Estimator) -> list[SmoothedTrack]:
    """The tracks after merging: the one that was confirmed first goes on.

    A junior ends only in a frame with a fix for either, so that no fix is lost.
    """
    after = list(tracks)
    alive = [k for k, t in enumerate(after) if t.confirmed and t.id > 0 and t.life.state is not TrackState.DROPPED]
    alive.sort(key=lambda k: (after[k].life.confirmed_ns or 0, after[k].id))
    for n, i in enumerate(alive):
        for j in alive[n + 1 :]:
            senior, junior = after[i], after[j]
            if TrackState.DROPPED in (senior.life.state, junior.life.state):
                continue
            if junior.fix is None and _may_be_one(senior, junior, estimator):
                estimator.rename(junior.id, senior.id)
                after[i], after[j] = senior.merged(junior)
    return after


def _may_be_one(one: SmoothedTrack, other: SmoothedTrack, estimator: Estimator) -> bool:
    live = estimator.live
    alike = one.label == other.label and one.moving == other.moving
    if live is None or not alike or other.id in one.together or one.id not in live or other.id not in live:
        return False
    (nn, _, _), (_, ee, _), _ = one.last_fix.noise_cov
    a, b = live.place(one.id)[0], live.place(other.id)[0]
    near2 = NEAR_NOISE2 * (nn + ee)
    if dist(a[:2].tolist(), b[:2].tolist()) ** 2 > near2:
        return False
    distance2, variance = separation2(live, one.id, other.id)
    return distance2 < SEPARATION2 and variance < near2
