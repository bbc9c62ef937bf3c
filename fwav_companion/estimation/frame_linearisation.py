"""Derivatives of a frame's sightings by the live filter's state."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fwav_companion.estimation.errors import CAMERA_DELAY, Array, Ints
from fwav_companion.estimation.frame_prediction import LinearisedPairs
from fwav_companion.estimation.ground import TARGET_SIZE
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.measurement import Projection, project
from fwav_companion.estimation.smoother import common_noise

if TYPE_CHECKING:
    from fwav_companion.estimation.live_filter import LiveFilter

_REACH_SIGMAS = math.sqrt(3.0)  # nodes of the Gauss-Hermite quadrature with three points; each outer one weighs a sixth


def linearise_pairs(live: LiveFilter, s: Sightings, detection: Ints, targets: Ints) -> LinearisedPairs:
    """Pairs (M,) of a frame's detections and targets, at the present means."""
    places = live.target_means(targets)
    ground, slope = live.model.ground.height(places[:2])
    point = np.stack([places[0], places[1], places[2] + ground])
    found, h = linearise(live, s, detection, point)
    base, own = h.swapaxes(1, 2).copy(), found.point.copy()  # (2, M, n), (2, 3, M)
    own[:, :2] += found.point[:, 2:] * slope
    for i, k in enumerate(targets.tolist()):
        if k in live.at:
            base[:, i, live.at[k] : live.at[k] + TARGET_SIZE] = own[..., i]
    own_noise = None if s.own_noise is None else s.own_noise.take(detection, -1)
    noise = common_noise(found, live.model.noise, own_noise)
    if own_noise is not None:
        noise = np.concatenate([noise, found.point * own_noise[[1, 1, 2]]], 1)
    return LinearisedPairs(
        detection, targets, found.residual, found.visible, base, own, noise.swapaxes(1, 2), live.mean.copy(), places
    )


def linearise(live: LiveFilter, s: Sightings, detection: Ints, point: Array) -> tuple[Projection, Array]:
    """Detections (M,) of a frame at points (3, M): the projection, and derivatives (2, n, M) by the base state."""
    rays, tangents, row = s.rays.take(detection, -1), s.tangents.take(detection, -1), s.row.take(detection)
    shared, error = live.mean[: live.size], live.mean[live.errors, None]
    found = project(live.poses.of(s, detection), rays, tangents, shared, point, error, row)
    h = np.zeros((2, len(live.mean), len(detection)))
    h[:, : live.size], h[:, live.error :] = found.shared, found.point
    if live.curved:
        # A delay's displacements (2, M) beyond its derivative: over one beat of a shaking vehicle they are as large
        # as what the derivative says. Even and odd in the delay, each with a variance of one.
        reach, beyond = _REACH_SIGMAS * float(live.covariance[CAMERA_DELAY, CAMERA_DELAY]) ** 0.5, []
        for later in (reach, -reach):
            there = project(live.poses.of(s, detection, later), rays, tangents, shared, point, error, row)
            off = found.residual - there.residual - later * found.shared[:, CAMERA_DELAY]
            beyond.append(np.where(there.visible & found.visible, off, 0.0) * (0.5 / _REACH_SIGMAS))
        h[:, live.error - 2], h[:, live.error - 1] = beyond[0] + beyond[1], beyond[0] - beyond[1]
    return found, h
