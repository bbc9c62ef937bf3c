"""Pairs of a frame's detections and targets that may belong together, before their joint covariance is computed."""

from __future__ import annotations

import numpy as np

from fwav_companion.estimation.errors import Array, Bools, Ints
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.live_filter import LiveFilter
from fwav_companion.estimation.measurement import feet

_FEW_PAIRS, _NEAREST = 24, 3


def near_pairs(live: LiveFilter, s: Sightings, targets: Ints, alike: Bools) -> tuple[Ints, Ints]:
    """Indices of detections and numbers of targets of the pairs (M,): all that are alike, or the nearest of many.

    alike: (D, T) pairs that may be one thing by their labels. The joint covariance grows with the square of the number
    of pairs; so of many a detection has those whose places are nearest to its ground point.
    """
    detection, column = np.nonzero(alike)
    if len(detection) <= _FEW_PAIRS:
        return detection.astype(np.int64), targets[column]
    place, mean = _ground_points(live, s), live.target_means(targets)[:2]
    far = np.where(alike, ((place[:, :, None] - mean[:, None, :]) ** 2).sum(0), np.inf)
    nearest = np.argsort(far, axis=1, kind="stable")[:, :_NEAREST]
    finite = np.isfinite(np.take_along_axis(far, nearest, 1))
    detection, column = np.nonzero(finite)
    return detection.astype(np.int64), targets[nearest[detection, column]]


def _ground_points(live: LiveFilter, s: Sightings) -> Array:
    """Ground points (2, D) of a frame's detections at the present calibration."""
    shared, error = live.mean[: live.size], live.mean[live.error :, None]
    poses = live.poses(s, np.arange(len(s)))
    ground = live.model.ground.height(poses.position[:2])[0]
    place, _ = feet(poses, s.rays, shared, error, float(ground.mean()))
    return place
