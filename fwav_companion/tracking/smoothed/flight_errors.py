"""Priors and noise of the smoother from the configuration's error priors."""

from __future__ import annotations

from math import hypot

import numpy as np

from fwav_companion.estimation.errors import (
    BODY_SHARED,
    CAMERA_DELAY,
    GIMBAL_DELAY,
    GIMBAL_HEADING,
    GIMBAL_SHARED,
    HEADING,
    HEIGHT,
    LEVER,
    MOUNT,
    PITCH,
    POSITION_DELAY,
    READOUT,
    ROLL,
    SampleNoise,
    SharedPriors,
    with_stored,
)
from fwav_companion.self_calibration import KeptCalibration
from fwav_companion.types import Bias, ErrorPriors

_SOURCES = {
    CAMERA_DELAY: Bias.TIME_OFFSET,
    MOUNT.start: Bias.MOUNT_X,
    MOUNT.start + 1: Bias.MOUNT_Y,
    MOUNT.start + 2: Bias.MOUNT_Z,
    HEADING: Bias.HEADING,
    ROLL: Bias.ROLL,
    PITCH: Bias.PITCH,
    HEIGHT: Bias.HEIGHT,
    POSITION_DELAY: Bias.POSITION_DELAY,
    LEVER.start: Bias.LEVER_X,
    LEVER.start + 1: Bias.LEVER_Y,
    LEVER.start + 2: Bias.LEVER_Z,
    READOUT: Bias.READOUT,
}
"""The bias of [uncertainty] behind each shared parameter."""


GRASS_M = 0.1
"""Least roughness of the ground under a rangefinder's beam."""


def shared_priors(priors: ErrorPriors, kept: KeptCalibration | None) -> SharedPriors:
    """Priors of the shared parameters. ``kept``: a calibration of an earlier flight; what it lacks has its prior.

    A kept mount is a correction (true minus configured); the smoother's errors are reported minus true. A gimbal's
    heading and delay are parameters of their own here, so that the vehicle's heading and the camera's delay count
    without them.
    """
    gimbal = priors.gimbal
    size = BODY_SHARED if gimbal is None else GIMBAL_SHARED
    mean, sigma = np.zeros(size), np.zeros(size)
    for index, bias in _SOURCES.items():
        sigma[index] = priors.sigma(bias)
    if gimbal is not None:
        sigma[HEADING], sigma[CAMERA_DELAY] = gimbal.vehicle_heading, gimbal.camera_delay_s
        sigma[GIMBAL_HEADING], sigma[GIMBAL_DELAY] = gimbal.heading, gimbal.delay_s
    configured = SharedPriors(mean, sigma)
    if kept is None:
        return configured
    stored, known = np.full(size, np.nan), np.full(size, np.nan)
    stored[CAMERA_DELAY], stored[MOUNT] = kept.time_offset_s, [-angle for angle in kept.mount]
    known[CAMERA_DELAY], known[MOUNT] = kept.time_offset_sigma_s, kept.mount_sigma
    if kept.position_delay_s is not None and kept.position_delay_sigma_s is not None:
        stored[POSITION_DELAY], known[POSITION_DELAY] = kept.position_delay_s, kept.position_delay_sigma_s
    if kept.lever_m is not None and kept.lever_sigma_m is not None:
        stored[LEVER], known[LEVER] = kept.lever_m, kept.lever_sigma_m
    return with_stored(configured, stored, known)


def sample_noise(
    priors: ErrorPriors, position_bias_m: float | None, stamp_sigma_s: float, height_wander_m: float = 0.0,
    *, relative: bool = False,
) -> SampleNoise:  # fmt: skip
    """Noise of single samples. ``position_bias_m``: the receiver's own accuracy; None: as configured.

    ``relative``: there is no position; the world's origin is below the camera, without an error.
    ``stamp_sigma_s``: of a picture's instant on the attitudes' clock. Telemetry has already corrected the mean delay of
    the attitudes' stamps. ``height_wander_m``: of the height above the ground (``flight_ground``).
    """
    wander_m = priors.sigma(Bias.POSITION_NORTH) if position_bias_m is None else position_bias_m
    position_noise_m = priors.position_noise_m
    if relative:
        wander_m = position_noise_m = 0.0
    return SampleNoise(
        attitude_rad=priors.attitude_noise,
        attitude_stamp_delay_s=0.0,
        position_m=hypot(position_noise_m, 1e-3),
        height_m=hypot(priors.height_noise_m, 1e-3),
        position_wander_m=wander_m,
        height_wander_m=height_wander_m,
        wander_times_s=priors.position_times_s,
        stamp_jitter_s=stamp_sigma_s,
        roughness_m=max(GRASS_M, priors.sigma(Bias.TERRAIN)),
    )
