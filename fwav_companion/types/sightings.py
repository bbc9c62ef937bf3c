"""A detection placed in time and on the vehicle, and the ground point it gives."""

from __future__ import annotations

from enum import IntEnum

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.types.camera import Detection, Ray
from fwav_companion.types.reasons import Reason
from fwav_companion.types.telemetry import VehicleState


class Bias(IntEnum):
    """Errors that many fixes share, in the order of every bias vector of this package."""

    ROLL = 0
    """Of the autopilot, rotation about body x, rad. On a gimbal: of its own attitude, about its own x."""
    PITCH = 1
    """Of the autopilot, rotation about body y, rad. On a gimbal: of its own attitude, about its own y."""
    HEADING = 2
    """Of the autopilot, rotation about down, rad."""
    MOUNT_X = 3
    """Rotation vector of the mount, body axes, rad. On a gimbal: of the camera on it, its axes."""
    MOUNT_Y = 4
    MOUNT_Z = 5
    TIME_OFFSET = 6
    """Of the camera's stamps, s; positive: they come later than configured."""
    READOUT = 7
    """Of the seconds from first row to last."""
    HEIGHT = 8
    """Camera above ground, m."""
    POSITION_NORTH = 9
    """Of the vehicle, m; wanders with its own time constant."""
    POSITION_EAST = 10
    TERRAIN = 11
    """Of the ground under the target, m up; common to fixes of one place."""


BIAS_COUNT = len(Bias)


class ErrorPriors(msgspec.Struct, frozen=True, kw_only=True):
    """[uncertainty] in radians, metres and seconds: one sigma each."""

    pixel_noise_px: float
    attitude_noise: float
    position_noise_m: float
    height_noise_m: float
    bias_sigmas: tuple[float, ...]
    """By :class:`Bias`."""
    position_bias_time_s: float

    def sigma(self, bias: Bias) -> float:
        """One sigma of this bias, in its unit."""
        return self.bias_sigmas[bias]


class Unpaired(msgspec.Struct, frozen=True):
    """The detection could not be placed in time or on the vehicle."""

    reason: Reason
    gap_s: float | None = None


class Sighting(msgspec.Struct, frozen=True, gc=False):
    """A detection with the vehicle's state at the instant its own row was exposed."""

    frame: int
    """The frame's number, its own or counted."""
    index: int
    """Of the detection in its frame."""
    frame_host_ns: HostNs
    """Capture of row 0, host clock."""
    host_ns: HostNs
    """Capture of the detection's row, host clock."""
    detection: Detection
    ray: Ray
    pixel_sigma: tuple[float, float]
    """One sigma of u and v, pixels."""
    row_fraction: float
    """d(capture)/d(Bias.READOUT): how far down the readout the detection's row lies, 0 to 1; times the frame interval
    over 1/30 s where the readout is unknown, since the bias's prior is that of 30 frames/s."""
    time_noise_s: float
    """One sigma of the capture's instant on the autopilot's clock that is fresh in this frame."""
    state: VehicleState
    body_from_camera: Matrix3
    """Of a camera on a gimbal: in the gimbal's axes."""
    ned_from_camera: Matrix3
    camera_ned: Vector3
    """The camera's centre, metres, local NED; in a relative world (0, 0, 0): the localizer knows the height."""
    camera_height_above_home_m: float | None
    """By the autopilot's relative altitude and the lever arm; None where nothing tells it."""
    relative: bool
    """There is no global position: the world is the point on the ground below the camera, down = 0 there."""

    @property
    def boot_ns(self) -> BootNs:
        """Capture of the detection's row, autopilot clock."""
        return self.state.boot_ns


class ErrorBudget(msgspec.Struct, frozen=True, gc=False):
    """One sigma of the horizontal position by cause: sqrt of the trace of each cause's horizontal covariance, m."""

    pixel: float
    attitude: float
    heading: float
    height: float
    time: float
    mount: float
    position: float
    terrain: float


class NoFix(msgspec.Struct, frozen=True):
    """The sighting meets no ground that can be told."""

    reason: Reason


class GroundFix(msgspec.Struct, frozen=True, gc=False):
    """Where the ray of one sighting meets the ground, with everything a tracker needs to weigh it."""

    sighting: Sighting
    position_ned: Vector3
    noise_cov: Matrix3
    """Of errors fresh in this sample, m^2, NED."""
    bias_jacobian: tuple[Vector3, ...]
    """d(position_ned)/d(bias), one column a :class:`Bias`: estimate minus truth per unit of error."""
    cov: Matrix3
    """Total: noise and all biases, m^2, NED."""
    relative_cov: Matrix3
    """The same without the vehicle's own position: of the target relative to the vehicle."""
    budget: ErrorBudget
    ground: str
    """The ground model that answered: home, fixed, rangefinder, terrain."""
    level_sigma_m: float = 0.0
    """One sigma of the ground's own level, down, which no bias tells. Its square is in ``cov`` and ``relative_cov`` but
    not in ``noise_cov``: it is the same in every fix, so no number of fixes averages it away."""
