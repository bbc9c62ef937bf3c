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
_NEAR_S = 0.01  # an interval of attitudes of 100 Hz: a frame waits for the attitude after its capture
_BEAT_RAD_S = 2.0 * math.pi * 5.0  # wing beat of 5 Hz


def linearise_pairs(live: LiveFilter, s: Sightings, detection: Ints, targets: Ints) -> LinearisedPairs:
    """Pairs (M,) of a frame's detections and targets, at the present means."""
    places = live.target_means(targets)
    ground, slope = live.model.ground.height(places[:2])
    point = places.copy()
    point[2] += ground
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
    unmeasured_m = live.poses.motion(float(s.t[0])).unmeasured_m
    if unmeasured_m > 0.0:
        noise = np.concatenate([noise, found.point[:, :2] * unmeasured_m], 1)
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
        h[:, live.error - 2], h[:, live.error - 1] = _beyond_derivative(live, s, detection, point, found)
    return found, h


def _beyond_derivative(
    live: LiveFilter, s: Sightings, detection: Ints, point: Array, found: Projection
) -> tuple[Array, Array]:
    """A delay's displacements (2, M) beyond its derivative, even and odd in the delay, each with a variance of one.

    Over one beat of a shaking vehicle they are as large as what the derivative says. Of a beat both parts are known by
    attitudes that a frame has in time: those of its past, and those a few milliseconds about it.
    """
    rays, tangents, row = s.rays.take(detection, -1), s.tangents.take(detection, -1), s.row.take(detection)
    shared, error = live.mean[: live.size], live.mean[live.errors, None]

    def moved(later_s: float) -> Array:
        there = project(live.poses.of(s, detection, later_s), rays, tangents, shared, point, error, row)
        off = found.residual - there.residual - later_s * found.shared[:, CAMERA_DELAY]
        return np.where(there.visible & found.visible, off, 0.0)

    sigma_s = float(live.covariance[CAMERA_DELAY, CAMERA_DELAY]) ** 0.5
    phase, reach_s = _BEAT_RAD_S * sigma_s, _REACH_SIGMAS * sigma_s
    slope = (moved(_NEAR_S) - moved(-_NEAR_S)) / (2.0 * _NEAR_S)
    even = (moved(reach_s) - reach_s * np.sinc(_BEAT_RAD_S * reach_s / np.pi) * slope) / _REACH_SIGMAS
    odd = slope * math.sqrt(0.5 * (1.0 - math.exp(-2.0 * phase * phase))) / _BEAT_RAD_S  # rms of a beat's sine
    return even, odd
