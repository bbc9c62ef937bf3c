"""The report of self-calibration, and the part of it that the next flight starts with. Loads without numpy."""

from __future__ import annotations

from enum import IntEnum, StrEnum
from math import hypot, isfinite

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types.flight_status import ParameterReport

MOST_PRIOR_SIGMAS = 6.0
"""Largest distance of a kept calibration from the configuration, prior sigmas: 1 flight in 500 million has a larger one
by chance. A flight that contradicts its prior keeps its result, but the next flight starts from the configuration."""


class SharedParameter(IntEnum):
    """Parameters that all targets share, in the order of every vector of the joint estimate."""

    DELAY = 0
    """Delay of the camera's stamps beyond the configured time offset, s."""
    MOUNT_X = 1
    """Rotation vector c of the mount's correction, body axes: the true mount is Exp(c) times the configured one."""
    MOUNT_Y = 2
    MOUNT_Z = 3
    HEADING = 4
    """Heading error: reported minus true, rad."""
    HEIGHT = 5
    """Error of the camera's height above ground: reported minus true, m."""
    READOUT = 6
    """Readout time: true minus configured, s."""
    POSITION_DELAY = 7
    """Age of the reported positions beyond the configured one, s."""
    LEVER_X = 8
    """Position of the camera in the body: configured minus true, m; with a gimbal, in its axes."""
    LEVER_Y = 9
    LEVER_Z = 10


class CalibrationStatus(StrEnum):
    """Progress of self-calibration."""

    WAITING = "waiting"
    """Too few measurements yet; every parameter keeps its prior."""
    AMBIGUOUS = "ambiguous"
    """Several delays explain the measurements equally well, because a steady beat repeats itself; every parameter keeps
    its prior."""
    UNEXPLAINED = "unexplained"
    """No delay within its prior explains the measurements; every parameter keeps its prior."""
    TIME = "time"
    """The delay is known; the mount needs other headings or ranges."""
    CALIBRATED = "calibrated"
    """Delay and mount are known."""


class PriorInflation(msgspec.Struct, frozen=True, gc=False):
    """A prior that the flight contradicts, and that is therefore made wider than configured."""

    parameter: int
    mean: float
    sigma: float
    """One sigma, as configured."""
    alone: float
    """Estimate from the flight without this prior."""

    @property
    def wider_sigma(self) -> float:
        """One sigma that is wide enough for the flight's estimate."""
        return hypot(self.sigma, self.alone - self.mean)


MOST_DELAY_S, MOST_LEVER_M = 10.0, 10.0
"""Largest kept error of the position's age, seconds, and of the camera's place in the body, metres."""


class KeptCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """A calibration of an earlier flight: a narrower prior than the configuration's.

    The sigma of its mount includes the heading's: another flight has another heading error.
    """

    time_offset_s: float
    time_offset_sigma_s: float
    mount: Vector3
    mount_sigma: Vector3
    position_delay_s: float | None = None
    """Positions are older than configured by this; None: not estimated, as by earlier versions."""
    position_delay_sigma_s: float | None = None
    lever_m: Vector3 | None = None
    """Error of the camera's position in the body: configured minus true; None: not estimated."""
    lever_sigma_m: Vector3 | None = None

    @property
    def is_sound(self) -> bool:
        """Whether all numbers are finite and all sigmas positive: the file may have been edited.

        A position is not older than MOST_DELAY_S, a camera not further from its place than MOST_LEVER_M.
        """
        delay = (self.position_delay_s, self.position_delay_sigma_s)
        if (delay[0] is None) != (delay[1] is None) or (self.lever_m is None) != (self.lever_sigma_m is None):
            return False
        if abs(delay[0] or 0.0) > MOST_DELAY_S or max(map(abs, self.lever_m or (0.0,))) > MOST_LEVER_M:
            return False
        numbers = (self.time_offset_s, *self.mount, delay[0] or 0.0, *(self.lever_m or ()))
        more = (1.0 if delay[1] is None else delay[1], *(self.lever_sigma_m or ()))
        sigmas = (self.time_offset_sigma_s, *self.mount_sigma, *more)
        return all(map(isfinite, numbers)) and all(isfinite(sigma) and sigma > 0.0 for sigma in sigmas)

    def implausible(self, time_offset_sigma_s: float, mount_sigma: Vector3) -> str:
        """The value that no flight of this configuration can have found, and what is accepted; "" if all are plausible.

        ``time_offset_sigma_s``, ``mount_sigma``: one sigma of the configured priors, s and rad.
        """
        if not self.is_sound:
            return f"{self} has a number that is not finite, or a sigma that is not above 0"
        most_s = MOST_PRIOR_SIGMAS * time_offset_sigma_s
        if abs(self.time_offset_s) > most_s:
            return f"time_offset_s {self.time_offset_s:g}; accepted: at most {most_s:g} either way (configured prior)"
        for axis, (angle, sigma) in enumerate(zip(self.mount, mount_sigma, strict=True)):
            if abs(angle) > MOST_PRIOR_SIGMAS * sigma:
                most = MOST_PRIOR_SIGMAS * sigma
                return f"mount[{axis}] {angle:g}; accepted: at most {most:g} rad either way (configured prior)"
        return ""


class CalibrationReport(msgspec.Struct, frozen=True, kw_only=True):
    """The state of self-calibration: corrections of the configuration."""

    host_ns: HostNs
    time_offset_s: float
    """Correction to add to the configured time offset, s."""
    time_offset_sigma_s: float
    mount: Vector3
    """Rotation vector, body axes, rad: the true mount is Exp(mount) times the configured one."""
    mount_sigma: Vector3
    height_m: float
    """Height above ground: reported minus true, m."""
    height_sigma_m: float
    status: CalibrationStatus
    reason: str | None = None
    """Text for people on what CALIBRATED still needs; None when calibrated."""
    alternatives: tuple[float, ...] = ()
    """Corrections of the time offset that explain the measurements equally well (AMBIGUOUS), likeliest first, s."""
    mistake: str = ""
    """A gross mistake in the mount, as a sentence; nothing is estimated meanwhile."""
    denied: tuple[PriorInflation, ...] = ()
    """Priors of delay, mount and height that this flight contradicts."""
    replaced: bool = False
    """Whether this flight contradicted the calibration of an earlier one, which was dropped."""
    keep: KeptCalibration | None = None
    """Calibration for the next flight; None while nothing is worth keeping."""
    parameters: tuple[ParameterReport, ...] = ()
    """Status of each parameter, where the smoother estimates."""
