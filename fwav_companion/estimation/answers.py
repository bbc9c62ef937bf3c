"""What the estimator reports: places of targets, shared parameters with their status."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fwav_companion.estimation.errors import LEAST_SIGMA, MOUNT, NAMES, PITCH, ROLL, Array, SharedPriors

Status = Literal["calibrated", "waiting", "contradicts"]
CONTRADICTION_SIGMAS = 4.0
CALIBRATED_SHARE = 0.5  # of the prior's sigma
_NEGLIGIBLE = np.array(
    [1e-3, *[1e-3] * 3, *[1e-3] * 3, 0.02, 1e-3, *[0.01] * 3, 2e-3, 1e-3, 1e-3]
)  # sigmas that need none


@dataclass(frozen=True)
class TargetAnswer:
    """A target at an instant."""

    place: Array  # (3,) m north, east, height
    covariance: Array  # (3, 3)
    relative: Array  # (3,) m north, east, up: target minus vehicle
    relative_covariance: Array  # (3, 3)
    velocity: Array  # (2,) m/s north, east; zero for a static target
    velocity_covariance: Array  # (2, 2)


@dataclass(frozen=True)
class ParameterStatus:
    """A shared parameter: reported minus true, in the unit of its name."""

    name: str
    estimate: float
    sigma: float
    prior_mean: float
    prior_sigma: float
    status: Status
    reason: str | None  # what is missing, or how far the estimate is from the configuration

    @property
    def is_known(self) -> bool:
        """Whether the flight shows the parameter, by its sigma."""
        return self.sigma < CALIBRATED_SHARE * self.prior_sigma

    @property
    def alone(self) -> float:
        """The estimate without its prior; the estimate itself where the flight shows nothing."""
        precision, prior = 1.0 / (self.sigma * self.sigma), 1.0 / (self.prior_sigma * self.prior_sigma)
        if precision <= 1.0001 * prior:
            return self.estimate
        return (precision * self.estimate - prior * self.prior_mean) / (precision - prior)


_MISSING = {
    "camera_delay_s": "turns or shaking while a target is in view",
    "mount_x_rad": "a target seen from several sides",
    "mount_y_rad": "a target seen from several sides",
    "mount_z_rad": "a target seen from several sides",
    "heading_rad": "a longer path over a target",
    "roll_rad": "attitudes of different tilt",
    "pitch_rad": "attitudes of different tilt",
    "height_m": "a path over a target that is longer than a quarter of the height, or a rangefinder",
    "position_delay_s": "changes of speed while a target is in view",
}


def parameter_statuses(
    priors: SharedPriors, mean: Array, sigma: Array, *, consider: bool
) -> tuple[ParameterStatus, ...]:
    """Status of each shared parameter: estimate (S,), its sigma (S,)."""
    statuses = []
    for i in range(len(priors)):
        name, prior_sigma = NAMES[i], float(priors.sigma[i])
        distance = abs(float(mean[i] - priors.mean[i])) / prior_sigma
        status: Status = "waiting"
        reason: str | None = _MISSING.get(name, "more motion while a target is in view")
        if distance > CONTRADICTION_SIGMAS:
            status, reason = "contradicts", contradiction(distance)
        elif consider:
            reason = "self-calibration is off"
        elif prior_sigma <= max(LEAST_SIGMA, float(_NEGLIGIBLE[i])) or sigma[i] < CALIBRATED_SHARE * prior_sigma:
            status, reason = "calibrated", None
        prior_mean = float(priors.mean[i])
        statuses.append(ParameterStatus(name, float(mean[i]), float(sigma[i]), prior_mean, prior_sigma, status, reason))
    return tuple(statuses)


def camera_tilt(priors: SharedPriors, mean: Array, covariance: Array) -> tuple[ParameterStatus, ParameterStatus]:
    """Status of mount and attitude together about the carrier's x and y axes; mean (n,), covariance (n, n)."""
    found = []
    for index, pair in enumerate(((MOUNT.start, ROLL), (MOUNT.start + 1, PITCH))):
        rows = np.array(pair)
        total, sigma = float(mean[rows].sum()), float(np.sqrt(covariance[np.ix_(rows, rows)].sum()))
        prior = float(np.hypot(*priors.sigma[rows]))
        known = sigma < CALIBRATED_SHARE * prior
        reason = None if known else "a target seen from several sides"
        name = ("mount_and_roll_rad", "mount_and_pitch_rad")[index]
        prior_mean = float(priors.mean[rows].sum())
        status: Status = "calibrated" if known else "waiting"
        distance = abs(total - prior_mean) / prior
        if distance > CONTRADICTION_SIGMAS:
            status, reason = "contradicts", contradiction(distance)
        found.append(ParameterStatus(name, total, sigma, prior_mean, prior, status, reason))
    return found[0], found[1]


def contradiction(sigmas: float) -> str:
    """The reason of a parameter that contradicts the configuration."""
    return f"{sigmas:.1f} sigmas from the configuration"
