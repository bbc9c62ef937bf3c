"""Pairs by the live filter: detections and targets that may belong together, and how far two targets are apart."""

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
    poses = live.poses.of(s, np.arange(len(s)))
    ground = live.model.ground.height(poses.position[:2])[0]
    place, _ = feet(poses, s.rays, shared, error, float(ground.mean()))
    return place


def separation2(live: LiveFilter, one: int, other: int) -> tuple[float, float]:
    """Squared Mahalanobis distance of two targets, and the trace of their difference's covariance, m^2.

    The errors that both share cancel: two targets may be far nearer to each other than each to its place.
    """
    (a, aa, a_base, _), (b, bb, b_base, _) = live.state(one), live.state(other)
    if one in live.at:
        cross = b_base[:2, live.at[one] : live.at[one] + 2].T
    elif other in live.at:
        cross = a_base[:2, live.at[other] : live.at[other] + 2]
    else:  # what two Schmidt targets have in common is what the base state explains
        gain = live.others.gains(np.array([live.others.at[one]]), live.covariance)[0]
        cross = gain[:2] @ b_base[:2].T
    covariance = aa[:2, :2] + bb[:2, :2] - cross - cross.T
    difference = a[:2] - b[:2]
    return float(difference @ np.linalg.solve(covariance, difference)), float(np.trace(covariance))
