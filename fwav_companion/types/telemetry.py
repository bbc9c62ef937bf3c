"""What the autopilot tells, as samples on its own clock, and the state of the vehicle at one instant."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.rotations import Quaternion
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types.reasons import Reason


class AttitudeSample(msgspec.Struct, frozen=True, gc=False):
    """One ATTITUDE or ATTITUDE_QUATERNION."""

    boot_ns: BootNs
    """Mean instant of validity: the message's stamp, corrected for truncation and for the delay of stamping."""
    ned_from_body: Quaternion
    rates: Vector3
    """Body rates as sent, rad/s, FRD: filtered and late by an unknown amount."""


class PositionSample(msgspec.Struct, frozen=True, gc=False):
    """One GLOBAL_POSITION_INT."""

    boot_ns: BootNs
    place: Geodetic
    height_above_home_m: float
    velocity_ned: Vector3
    """m/s."""


class HeightSource(StrEnum):
    """Where a height above home comes from, in order of preference."""

    GLOBAL_POSITION_INT = "GLOBAL_POSITION_INT"
    ALTITUDE = "ALTITUDE"
    VFR_HUD = "VFR_HUD"


class RangeSample(msgspec.Struct, frozen=True, gc=False):
    """One DISTANCE_SENSOR reading inside its own limits."""

    boot_ns: BootNs
    distance_m: float
    beam_in_body: Vector3
    """Unit vector along the beam, body FRD, by the message's orientation."""
    sigma_m: float
    """From the message's covariance where it tells one, else 0."""


class ClockExchange(msgspec.Struct, frozen=True, gc=False):
    """One answered TIMESYNC request of ours."""

    sent_ns: HostNs
    received_ns: HostNs
    autopilot_ns: BootNs
    """The responder's clock between the two."""


class ClockStatus(StrEnum):
    """How far the clock may be trusted."""

    UNKNOWN = "unknown"
    """Nothing heard yet."""
    ARRIVALS = "arrivals"
    """No TIMESYNC answers: the lower envelope of arrival minus stamp. Biased late by the least transport delay."""
    SETTLING = "settling"
    """TIMESYNC answers, but few."""
    SETTLED = "settled"


class ClockEstimate(msgspec.Struct, frozen=True):
    """``host = boot + host_from_autopilot`` at one host instant."""

    at_ns: HostNs
    host_from_autopilot_ns: int
    skew: float
    """d(host_from_autopilot)/d(host): dimensionless, 1e-6 is one ppm."""
    sigma_s: float
    """One sigma, calibrated for symmetric delays."""
    bound_s: float
    """Hard: half the best round trip, plus 600 ppm of the time since."""
    round_trip_s: float | None
    status: ClockStatus


class GimbalAt(msgspec.Struct, frozen=True, gc=False):
    """The gimbal that carries the camera, at one instant."""

    ned_from_gimbal: Quaternion
    """Its x axis is where a camera without a further mount looks, y the image's right."""
    rates: Vector3
    """Its angular velocity, rad/s, its own axes, from its attitude's own course."""
    sigma: float
    """What interpolation, extrapolation and the doubt about its clock add, one sigma about each axis, radians."""
    gap_s: float
    """To the nearest attitude of it, seconds, >= 0."""


class VehicleState(msgspec.Struct, frozen=True, gc=False):
    """The vehicle at one instant, interpolated. Telemetry's answer to pairing."""

    boot_ns: BootNs
    ned_from_body: Quaternion
    rates: Vector3
    """Angular velocity of the body, rad/s, body axes, from the attitude's own course."""
    attitude_sigma: float
    """What interpolation or extrapolation adds, one sigma about each axis, radians."""
    gap_s: float
    """To the nearest attitude sample, seconds, >= 0."""
    position_ned: Vector3 | None
    """Metres in the local world; None without a global position."""
    velocity_ned: Vector3 | None
    """m/s; None where it is not told."""
    position_sigma_m: float
    """What the age of the position adds, one sigma an axis."""
    height_above_home_m: float | None
    """By the autopilot's relative altitude; None where nothing tells it."""
    range: RangeSample | None = None
    """The rangefinder's reading near this instant, if it is usable."""
    terrain_height_m: float | None = None
    """TERRAIN_REPORT's current_height near this instant."""
    stamp_sigma_s: float = 0.0
    """One sigma of the instant that the stamps of the attitudes leave open."""
    spacing_s: float = 0.0
    """Between the attitudes around this instant: the closer they are, the noisier are rates taken from them."""
    gimbal: GimbalAt | Reason | None = None
    """What carries the camera in the body's place, or why its attitude is not known; None: the camera is fixed to the
    body."""

    @property
    def ned_from_carrier(self) -> Quaternion:
        """The attitude of what carries the camera: the gimbal's where there is one, else the body's."""
        return self.gimbal.ned_from_gimbal if isinstance(self.gimbal, GimbalAt) else self.ned_from_body

    @property
    def carrier_rates(self) -> Vector3:
        """The angular velocity of what carries the camera, rad/s, its own axes."""
        return self.gimbal.rates if isinstance(self.gimbal, GimbalAt) else self.rates

    @property
    def carrier_sigma(self) -> float:
        """What its interpolation adds, one sigma about each axis, radians."""
        return self.gimbal.sigma if isinstance(self.gimbal, GimbalAt) else self.attitude_sigma
