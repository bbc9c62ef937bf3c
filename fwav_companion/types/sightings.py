"""Sightings (detections with the state of the vehicle at their capture), ground fixes, and their error model."""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, Protocol, TypeAlias

import msgspec
from msgspec import Meta

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.types.camera import Detection, Ray
from fwav_companion.types.reasons import Reason
from fwav_companion.types.telemetry import VehicleState


class Bias(IntEnum):
    """Errors that are common to many fixes, in the order of every bias vector of this package."""

    ROLL = 0
    """Rotation error of the autopilot's attitude about body x, rad; with a gimbal, of the gimbal's about its x."""
    PITCH = 1
    """Rotation error of the autopilot's attitude about body y, rad; with a gimbal, of the gimbal's about its y."""
    HEADING = 2
    """Rotation error of the autopilot's attitude about down, rad."""
    MOUNT_X = 3
    """Rotation vector of the mount error, body axes, rad; with a gimbal, its axes."""
    MOUNT_Y = 4
    MOUNT_Z = 5
    TIME_OFFSET = 6
    """Error of the time offset of the camera's stamps, s; positive: stamps come later than configured."""
    READOUT = 7
    """Error of the readout time from the first row to the last, s."""
    HEIGHT = 8
    """Error of the camera's height above ground, m."""
    POSITION_NORTH = 9
    """Position error of the vehicle, m: a first-order Gauss-Markov process with a time constant of its own."""
    POSITION_EAST = 10
    TERRAIN = 11
    """Error of the terrain height at the target, m up; common to the fixes of one place."""
    POSITION_DELAY = 12
    """Error of the configured age of positions, s; positive: positions are older than configured."""
    LEVER_X = 13
    """Error of the camera's configured position in the body, and of the antenna's, m: configured minus true."""
    LEVER_Y = 14
    LEVER_Z = 15
    TARGET_HEIGHT = 16
    """Error of the height at which a standing target is detected, in units of the sigma of its [[target]]."""


BIAS_COUNT = len(Bias)


class GimbalSigmas(msgspec.Struct, frozen=True, kw_only=True):
    """One sigma of a gimbal's own errors, and of those of vehicle and camera without them, radians and seconds."""

    heading: float
    delay_s: float
    vehicle_heading: float
    camera_delay_s: float


class ErrorPriors(msgspec.Struct, frozen=True, kw_only=True):
    """One sigma of every error of [uncertainty], in radians, metres and seconds."""

    pixel_noise_px: float
    attitude_noise: float
    position_noise_m: float
    height_noise_m: float
    bias_sigmas: tuple[float, ...]
    """One sigma of each :class:`Bias`; a gimbal's heading and delay are in those of the vehicle and of the camera."""
    gimbal: GimbalSigmas | None = None
    """Errors of the gimbal that carries the camera, for an estimator that knows them apart; None without one."""
    position_bias_time_s: float
    """Time constant of the position bias, seconds; the shortest likely one where it is not known."""
    position_wander_times_s: tuple[float, ...] = ()
    """Candidate time constants of a smoothly wandering position, seconds; empty: ``position_bias_time_s`` alone."""

    @property
    def position_times_s(self) -> tuple[float, ...]:
        """Time constants of the position's wander, seconds."""
        return self.position_wander_times_s or (self.position_bias_time_s,)

    def sigma(self, bias: Bias) -> float:
        """One sigma of one bias, in its unit."""
        return self.bias_sigmas[bias]


class Unpaired(msgspec.Struct, frozen=True):
    """The reason why a detection has no vehicle state at its capture."""

    reason: Reason
    gap_s: float | None = None


class SizeHeight(msgspec.Struct, frozen=True, gc=False):
    """Height of the camera above the detected point by the size of a tag in the picture."""

    height_m: float
    noise_m: float
    """One sigma that is independent in every picture, metres."""
    scale_sigma: float
    """One sigma of the scale, the same in every picture, as a share of the height: of the print and of the lens."""


class Sighting(msgspec.Struct, frozen=True, gc=False):
    """A detection with the state of the vehicle at the instant at which its row was exposed."""

    frame: int
    """Frame number: the source's, or counted where it sends none."""
    index: int
    """Index of the detection in its frame."""
    frame_host_ns: HostNs
    """Capture of row 0, host clock."""
    host_ns: HostNs
    """Capture of the detection's row, host clock."""
    detection: Detection
    ray: Ray
    pixel_sigma: tuple[float, float]
    """One sigma of u and v, pixels."""
    row_fraction: float
    """d(capture)/d(Bias.READOUT): position of the detection's row in the readout, 0 to 1. Where the readout is unknown,
    this value is multiplied by the frame interval over 1/30 s, because the prior of the bias is that of 30 frames/s."""
    time_noise_s: float
    """One sigma of the capture on the autopilot clock, independent in every frame, seconds."""
    state: VehicleState
    body_from_camera: Matrix3
    """Mount in use; ``body`` is the gimbal for a camera on a gimbal."""
    ned_from_camera: Matrix3
    camera_ned: Vector3
    """Camera position in local NED, metres. In a relative world it is (0, 0, 0), and the localizer adds the height."""
    camera_height_above_home_m: float | None
    """Camera height above home, from relative altitude and lever arm, metres; None where it is not known."""
    relative: bool
    """Whether there is no global position; then the origin is the point on the ground below the camera, down = 0."""
    anchor_height_m: float = 0.0
    """Height of the detected point above the target's foot, metres; 0 for a target that lies on the ground."""
    anchor_sigma_m: float = 0.0
    """One sigma of that height, the same in every sighting of a target, metres."""
    size_height: SizeHeight | None = None
    """Height above the detected point by a tag's known size; None for other things."""

    @property
    def boot_ns(self) -> BootNs:
        """Capture of the detection's row, autopilot clock."""
        return self.state.boot_ns


SigmaMetres: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e8)]
"""One sigma, metres; a recording's of more than several Earths is damage."""


class ErrorBudget(msgspec.Struct, frozen=True, gc=False, omit_defaults=True):
    """One sigma of the horizontal position by cause, m: square root of the trace of each cause's covariance."""

    pixel: SigmaMetres
    attitude: SigmaMetres
    heading: SigmaMetres
    height: SigmaMetres
    time: SigmaMetres
    mount: SigmaMetres
    position: SigmaMetres
    terrain: SigmaMetres
    target: SigmaMetres | None = None
    """Height of a standing target; None of one that lies on the ground: recordings then have no such key."""


class NoFix(msgspec.Struct, frozen=True):
    """The reason why a sighting gives no ground fix."""

    reason: Reason


class FixErrors(Protocol):
    """Covariances and error budget of a fix, computed when they are first read."""

    @property
    def cov(self) -> Matrix3:
        """Total covariance: noise and all biases, NED, m^2."""

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the target relative to the vehicle, NED, m^2: without the error of the vehicle's position."""

    @property
    def budget(self) -> ErrorBudget:
        """One sigma of the horizontal position by cause."""


class GroundFix(msgspec.Struct, frozen=True, gc=False):
    """Intersection of one sighting's ray with the ground, and its error model with noise and biases separate.

    In numpy, with J of the bias columns, S of the squared prior sigmas and L = diag(0, 0, level_sigma_m^2)::

        cov = noise_cov + J @ S @ J.T + L
    """

    sighting: Sighting
    position_ned: Vector3
    """Position in local NED, metres."""
    noise_cov: Matrix3
    """Covariance of the errors that are independent in every fix, NED, m^2."""
    bias_jacobian: tuple[Vector3, ...]
    """d(position_ned)/d(bias), one column for each :class:`Bias`: estimate minus truth per unit of error. Where the
    receiver gives the sigma of its position, the columns of the position are multiplied by that sigma over the prior's.
    The readout's column is scaled likewise."""
    errors: FixErrors
    """Covariances and error budget, computed when they are first read."""
    ground: str
    """Ground model of the intersection: home, fixed, rangefinder or terrain."""
    level_sigma_m: float = 0.0
    """One sigma of the ground's level, down, metres. It is not among the biases. Its square is part of ``cov``
    and ``relative_cov``, not of ``noise_cov``: the error is the same in every fix and does not average out."""
    best_height_m: float | None = None
    """Height of the camera above the detected point by the ground model and a tag's size, metres; None without one."""

    @property
    def height_above_target_m(self) -> float:
        """Height of the camera above the detected point, metres. The point is on the ground, or higher on a target."""
        if self.best_height_m is not None:
            return self.best_height_m
        return self.position_ned[2] - self.sighting.camera_ned[2] - self.sighting.anchor_height_m

    @property
    def cov(self) -> Matrix3:
        """Total covariance: noise and all biases, NED, m^2."""
        return self.errors.cov

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the target relative to the vehicle, NED, m^2: without the error of the vehicle's position."""
        return self.errors.relative_cov

    @property
    def budget(self) -> ErrorBudget:
        """One sigma of the horizontal position by cause."""
        return self.errors.budget
