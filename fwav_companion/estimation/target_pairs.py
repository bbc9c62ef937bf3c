"""Pairs by the live filter: detections and targets that may belong together, and how far two targets are apart."""

from __future__ import annotations

import numpy as np

from fwav_companion.estimation.errors import Array, Bools, Ints
from fwav_companion.estimation.ground import TARGET_SIZE
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


def separation2(live: LiveFilter, one: int, other: int) -> tuple[float, float]:
    """Squared Mahalanobis distance of two targets, and the trace of their difference's covariance, m^2.

    The errors that both share cancel: two targets may be far nearer to each other than each to its place.
    """
    (a, aa, _, _), (b, bb, _, _) = live.state(one), live.state(other)
    cross = _between(live, one, other)[:2, :2]
    covariance = aa[:2, :2] + bb[:2, :2] - cross - cross.T
    difference = a[:2] - b[:2]
    return float(difference @ np.linalg.solve(covariance, difference)), float(np.trace(covariance))


def _between(live: LiveFilter, one: int, other: int) -> Array:
    """Covariance (3, 3) of two targets; what two Schmidt targets have in common is what the base state explains."""
    if one in live.at:
        i = live.at[one]
        return np.asarray(live.cross(other)[:, i : i + TARGET_SIZE].T)
    if other in live.at:
        i = live.at[other]
        return np.asarray(live.cross(one)[:, i : i + TARGET_SIZE])
    gain = live.others.gains(np.array([live.others.at[one]]), live.covariance)[0]
    return np.asarray(gain @ live.cross(other).T)
