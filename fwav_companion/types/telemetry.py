"""Telemetry samples on the autopilot clock, the clock estimate, and the state of the vehicle at one instant."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.rotations import Quaternion
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import ZERO3, Vector3
from fwav_companion.types.reasons import Reason


class AttitudeSample(msgspec.Struct, frozen=True, gc=False):
    """One sample of ATTITUDE or ATTITUDE_QUATERNION."""

    boot_ns: BootNs
    """Mean instant of the sampling: stamp of the message, corrected for truncation and for the delay of stamping."""
    ned_from_body: Quaternion
    rates: Vector3
    """Body rates as sent, FRD, rad/s: low-pass filtered by the autopilot, and late by an unknown amount."""


class PositionSample(msgspec.Struct, frozen=True, gc=False):
    """One sample of GLOBAL_POSITION_INT."""

    boot_ns: BootNs
    place: Geodetic
    height_above_home_m: float
    velocity_ned: Vector3
    """Velocity in NED, m/s."""


class HeightSource(StrEnum):
    """Sources of the height above home, in order of preference."""

    GLOBAL_POSITION_INT = "GLOBAL_POSITION_INT"
    ALTITUDE = "ALTITUDE"
    VFR_HUD = "VFR_HUD"
    BAROMETER = "barometer"
    """Barometric altitude above its mean while disarmed, of any of three messages."""


class RangeSample(msgspec.Struct, frozen=True, gc=False):
    """One DISTANCE_SENSOR reading inside the sensor's own limits."""

    boot_ns: BootNs
    distance_m: float
    beam_in_body: Vector3
    """Unit vector along the beam, body FRD, from the orientation in the message."""
    sigma_m: float
    """One sigma of the distance, metres; 0 where the message has no covariance."""


class ClockExchange(msgspec.Struct, frozen=True, gc=False):
    """One TIMESYNC request of the service with its response."""

    sent_ns: HostNs
    received_ns: HostNs
    autopilot_ns: BootNs
    """Clock of the responder, between the two host instants; ArduPilot dates it back by what it has not read."""
    link: str = ""
    """Name of the link of request and answer; "" in a recording."""
    request_ns: int = 0
    """Time of the request's bytes on a serial line, for an autopilot that stamps their beginning; else 0."""
    beside_ns: int = 0
    """Time of the relayed bytes that travelled with the request: its reception may be dated back by them."""


class ClockStatus(StrEnum):
    """Quality of the clock estimate."""

    UNKNOWN = "unknown"
    """No message was received yet."""
    ARRIVALS = "arrivals"
    """No TIMESYNC responses: lower envelope of arrival minus stamp, late by the least transport delay."""
    SETTLING = "settling"
    """Few TIMESYNC responses were received."""
    SETTLED = "settled"
    FOLLOWED = "followed"
    """The clock slips, or runs at another rate than a crystal's; the estimate follows it response by response."""


class ClockEstimate(msgspec.Struct, frozen=True):
    """Estimate of the offset in ``host = boot + host_from_autopilot`` at one host instant."""

    at_ns: HostNs
    host_from_autopilot_ns: int
    skew: float
    """d(host_from_autopilot)/d(host): dimensionless, 1e-6 is one ppm."""
    sigma_s: float
    """One sigma of the offset, seconds, for symmetric delays."""
    bound_s: float
    """Hard bound of the error, seconds: half the best round trip, plus 600 ppm of the time since; for a followed clock,
    plus the largest rate error that round trips allow."""
    round_trip_s: float | None
    status: ClockStatus
    asymmetry_s: float = 0.0
    """Part of :attr:`sigma_s` that no response reduces: half of the least round trip, or the least delay."""
    rate_differs: bool = False
    """Whether the rate differs from 1 beyond three sigmas and 200 ppm."""

    @property
    def rate(self) -> float:
        """Autopilot seconds per host second."""
        return 1.0 - self.skew


class TakeOffSource(StrEnum):
    """Source of the take-off place, from the weakest to the strongest."""

    ASSUMED = "assumed"
    """Place where the vehicle was first received; it may have been in the air."""
    STANDING = "standing"
    """Place of a disarmed vehicle at rest."""
    ARMING = "arming"
    """Place where the vehicle was armed."""
    LANDING = "landing"
    """Place where a vehicle that has flown is at rest and disarmed."""
    HOME_POSITION = "home_position"
    POSES = "poses"
    """Photographs with poses: there is no take-off, and altitudes are above sea level."""
    LANDMARK = "landmark"
    """The vehicle's altitude as a landmark shows it, not a place of the vehicle."""


class TakeOff(msgspec.Struct, frozen=True):
    """The take-off place as far as it is known."""

    place: Geodetic
    """Take-off place; its altitude is that of the ground."""
    source: TakeOffSource


class GimbalAt(msgspec.Struct, frozen=True, gc=False):
    """State of the gimbal that carries the camera at one instant."""

    ned_from_gimbal: Quaternion
    """Attitude. A camera without a further mount looks along the x axis; its image's right is along y."""
    rates: Vector3
    """Angular velocity, gimbal axes, rad/s, from the attitude samples."""
    sigma: float
    """One sigma about each axis due to interpolation, extrapolation and the gimbal's clock, radians."""
    gap_s: float
    """Time to the nearest attitude sample of the gimbal, seconds, >= 0."""
    tilt_sigma: float = 0.0
    """One sigma of a slow error of roll and pitch in addition to the configured one, radians."""


class ReportedGimbal(msgspec.Struct, frozen=True, gc=False):
    """A gimbal's attitude as its reports show it."""

    attitude: Quaternion
    """Levelled; its yaw counts from north or from the vehicle's heading."""
    from_north: bool
    sigma: float
    """One sigma about each axis by interpolation, radians."""


class VehicleState(msgspec.Struct, frozen=True, gc=False):
    """Interpolated state of the vehicle at one instant."""

    boot_ns: BootNs
    ned_from_body: Quaternion
    rates: Vector3
    """Angular velocity of the body, body axes, rad/s, from the attitude samples."""
    attitude_sigma: float
    """One sigma about each axis due to interpolation or extrapolation, radians."""
    gap_s: float
    """Time to the nearest attitude sample, seconds, >= 0."""
    position_ned: Vector3 | None
    """Position in local NED, metres; None without a global position."""
    velocity_ned: Vector3 | None
    """Velocity in NED, m/s; None where it is not known."""
    position_sigma_m: float
    """One sigma of the position due to its age, metres an axis."""
    height_above_home_m: float | None
    """Height above home by the autopilot's relative altitude, metres; None where it is not known."""
    range: RangeSample | None = None
    """Usable reading of the rangefinder close to this instant."""
    terrain_height_m: float | None = None
    """Height above the terrain by TERRAIN_REPORT.current_height close to this instant, metres."""
    stamp_sigma_s: float = 0.0
    """One sigma of the instant due to the delay of the attitude stamps, seconds."""
    spacing_s: float = 0.0
    """Interval of the attitude samples around this instant, seconds; rates over shorter intervals are noisier."""
    position_bias_m: float | None = None
    """One sigma of the position's slow error as the receiver reports it, metres an axis; None: as configured."""
    position_drifts: bool = False
    """Whether that error drifts with the way flown, as a local position's does: it grows and does not return."""
    height_sigma_m: float | None = None
    """One sigma of the height at this instant, metres; None: as ``position_sigma_m``."""
    height_bias_m: float | None = None
    """One sigma of the height's slow error where a barometer alone shows the height, metres; None: as configured."""
    angular_acceleration: Vector3 = ZERO3
    """Angular acceleration of the body, body axes, rad/s^2, from the attitude samples; zero where it is not known."""
    turning_frequency: float = 0.0
    """Angular frequency of the body's rotational oscillation, rad/s; 0 where it is not known."""
    gimbal: GimbalAt | Reason | None = None
    """Gimbal that carries the camera, or the reason why its attitude is not known; None: camera fixed to the body."""

    @property
    def ned_from_carrier(self) -> Quaternion:
        """Attitude of the carrier of the camera: the gimbal where there is one, else the body."""
        return self.gimbal.ned_from_gimbal if isinstance(self.gimbal, GimbalAt) else self.ned_from_body

    @property
    def carrier_rates(self) -> Vector3:
        """Angular velocity of the carrier of the camera, its own axes, rad/s."""
        return self.gimbal.rates if isinstance(self.gimbal, GimbalAt) else self.rates

    @property
    def carrier_acceleration(self) -> Vector3:
        """Angular acceleration of the carrier of the camera, its own axes, rad/s^2; zero for a gimbal."""
        return ZERO3 if isinstance(self.gimbal, GimbalAt) else self.angular_acceleration

    @property
    def carrier_sigma(self) -> float:
        """One sigma of the carrier's attitude about each axis due to interpolation, radians."""
        return self.gimbal.sigma if isinstance(self.gimbal, GimbalAt) else self.attitude_sigma
