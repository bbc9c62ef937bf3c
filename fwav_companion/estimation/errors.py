"""The errors that all sightings of a flight share: one enumeration, one sign rule, their priors.

Sign rule for every parameter and for the position's error: reported minus true. A stamp that comes late has a positive
delay; a reported height that is too large has a positive height error. An estimate is subtracted from the report.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

CAMERA_DELAY: Final = 0  # s, the camera's stamps
MOUNT: Final = slice(1, 4)  # rad, rotation vector in carrier axes: the configured mount against the true one
HEADING: Final = 4  # rad, the attitude's heading
ROLL: Final = 5  # rad, the attitude's roll, about the carrier's x axis
PITCH: Final = 6  # rad, the attitude's pitch, about the level axis to the right
HEIGHT: Final = 7  # m, constant part of the height's error
POSITION_DELAY: Final = 8  # s, the position's stamps
LEVER: Final = slice(9, 12)  # m, carrier axes: minus the vector from the reported position to the camera
READOUT: Final = 12  # s, from the first row to the last; a sighting's share is its row's part of it
BODY_SHARED: Final = 13
GIMBAL_HEADING: Final = 13  # rad, the gimbal's own heading; only where a gimbal is configured
GIMBAL_DELAY: Final = 14  # s, the gimbal's stamps
GIMBAL_SHARED: Final = 15

NAMES: Final = (
    "camera_delay_s", "mount_x_rad", "mount_y_rad", "mount_z_rad", "heading_rad", "roll_rad", "pitch_rad", "height_m",
    "position_delay_s", "lever_x_m", "lever_y_m", "lever_z_m", "readout_s", "gimbal_heading_rad", "gimbal_delay_s",
)  # fmt: skip

LEAST_SIGMA: Final = 1e-7  # a prior of zero becomes this: the matrices stay regular, no claim becomes zero by it
# A stored value is of another day: a camera's clock and a mount change by about this between two flights.
STORED_DELAY_SIGMA_S: Final = 2e-3
STORED_MOUNT_SIGMA_RAD: Final = 3.5e-3
_STORED: Final = np.array([CAMERA_DELAY, 1, 2, 3, POSITION_DELAY, 9, 10, 11])


@dataclass(frozen=True)
class SharedPriors:
    """Means and standard deviations (S,) of the shared parameters; S is 13, or 15 with a gimbal."""

    mean: Array
    sigma: Array

    def __post_init__(self) -> None:
        if self.mean.shape != self.sigma.shape or len(self.mean) not in (BODY_SHARED, GIMBAL_SHARED):
            raise ValueError(f"priors of {self.mean.shape} and {self.sigma.shape} parameters, not of 13 or 15")
        if not (np.isfinite(self.mean).all() and np.isfinite(self.sigma).all() and (self.sigma >= 0).all()):
            raise ValueError("a prior is not a finite mean with a finite sigma of zero or more")
        object.__setattr__(self, "sigma", np.maximum(self.sigma, LEAST_SIGMA))

    def __len__(self) -> int:
        return len(self.mean)

    @property
    def precision(self) -> Array:
        """(S,)."""
        return self.sigma**-2.0


@dataclass(frozen=True)
class SampleNoise:
    """What is fresh in every sample, and how the position wanders; standard deviations."""

    attitude_rad: float = 0.00175  # white, about each axis
    attitude_stamp_delay_s: float = 0.0025  # an attitude is older than its stamp by 0 to this, uniformly
    position_m: float = 0.02  # white, north and east
    height_m: float = 0.1  # white
    position_wander_m: float = 0.0  # slow error, north and east
    height_wander_m: float = 0.0
    wander_times_s: tuple[float, ...] = (30.0, 1800.0)  # correlation times, the variance shared equally
    stamp_jitter_s: float = 0.0  # white, of a picture's stamp
    roughness_m: float = 0.1  # of the ground under a rangefinder's beam: grass


def priors(
    *, camera_delay_s: float = 0.05, mount_rad: float = 0.0175, heading_rad: float = 0.035, tilt_rad: float = 0.0087,
    height_m: float = 0.5, position_delay_s: float = 0.0, lever_arm_m: float = 0.0,
    readout_s: float = 0.0, gimbal: tuple[float, float] | None = None,
) -> SharedPriors:  # fmt: skip
    """Zero-mean priors; `gimbal`: sigmas of its heading (rad) and of its delay (s)."""
    sigma = np.zeros(BODY_SHARED if gimbal is None else GIMBAL_SHARED)
    sigma[CAMERA_DELAY], sigma[MOUNT], sigma[HEADING] = camera_delay_s, mount_rad, heading_rad
    sigma[[ROLL, PITCH]] = tilt_rad
    sigma[HEIGHT], sigma[POSITION_DELAY], sigma[LEVER] = height_m, position_delay_s, lever_arm_m
    sigma[READOUT] = readout_s
    if gimbal is not None:
        sigma[GIMBAL_HEADING], sigma[GIMBAL_DELAY] = gimbal
    return SharedPriors(np.zeros_like(sigma), sigma)


def with_stored(prior: SharedPriors, mean: Array, sigma: Array) -> SharedPriors:
    """The priors of a flight that follows another; (S,) of the last flight, NaN where nothing was stored.

    Only what belongs to the vehicle is taken: heading, tilt and height change at every start. No sigma becomes larger
    than the configuration's.
    """
    new_mean, new_sigma = prior.mean.copy(), prior.sigma.copy()
    widened = np.zeros(len(prior))
    widened[[CAMERA_DELAY, POSITION_DELAY]], widened[MOUNT] = STORED_DELAY_SIGMA_S, STORED_MOUNT_SIGMA_RAD
    for i in _STORED.tolist():
        if i < len(mean) and np.isfinite(mean[i]) and np.isfinite(sigma[i]):
            total = float(np.hypot(sigma[i], widened[i]))
            if total < prior.sigma[i]:
                new_mean[i], new_sigma[i] = mean[i], total
    return replace(prior, mean=new_mean, sigma=new_sigma)
