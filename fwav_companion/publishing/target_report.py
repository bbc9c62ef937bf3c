"""One target at one instant: its place on the earth, relative to the vehicle, and its accuracy. Pure."""

from __future__ import annotations

from math import atan2, hypot, isfinite, nan, sqrt

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.stamps import NS_PER_MS, HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3, Vector3, add, larger_semi_axis, norm, scale, subtract
from fwav_companion.types.flight_status import TrackReport
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track

MAX_PREDICTED_S = 1.0
"""Longest prediction of a moving target by its velocity, seconds: without a new fix the velocity soon becomes
invalid."""
FLOAT32_MAX = 3.4e38


class TargetReport(msgspec.Struct, frozen=True):
    """A track's position and accuracy at the present instant."""

    track: Track
    position_ned: Vector3
    """Position in NED about the origin, metres; predicted to now where the target moves."""
    place: Geodetic | None
    """Position on the earth; None without a global position."""
    from_vehicle: Vector3 | None
    """Vector from the vehicle, NED, metres; None where the vehicle's position is unknown."""
    horizontal_sigma_m: float
    """One sigma along the larger semi-axis, metres."""
    vertical_sigma_m: float

    @property
    def distance_m(self) -> float:
        """Distance from the vehicle, metres; NaN where unknown."""
        return norm(self.from_vehicle) if self.from_vehicle is not None else nan

    @property
    def bearing(self) -> float:
        """Bearing from the vehicle, radians from north, in (-pi, pi]; NaN where unknown."""
        return atan2(self.from_vehicle[1], self.from_vehicle[0]) if self.from_vehicle is not None else nan


def target_report(track: Track, situation: Situation) -> TargetReport:
    """The track at the present instant."""
    position, apparent = track.position_ned, track.apparent_ned
    if track.velocity_ned is not None:
        age_s = s_from_ns(situation.now_ns - track.host_ns)
        moved = scale(track.velocity_ned, min(max(age_s, 0.0), MAX_PREDICTED_S))
        position, apparent = add(position, moved), add(apparent, moved)
    vehicle = situation.recent_vehicle
    return TargetReport(
        track=track,
        position_ned=position,
        place=situation.plane.geodetic_from_ned(position) if situation.plane is not None else None,
        from_vehicle=_from_vehicle(apparent, situation) if vehicle is not None else None,
        horizontal_sigma_m=larger_sigma(track.cov),
        vertical_sigma_m=sqrt(track.cov[2][2]) if track.cov[2][2] >= 0.0 else nan,
    )


def track_report(track: Track, plane: TangentPlane | None, now: HostNs) -> TrackReport:
    """The track for the status."""
    place = plane.geodetic_from_ned(track.position_ned) if plane is not None else None
    return TrackReport(
        track=track.id,
        label=track.label,
        state=track.state.value,
        lat=None if place is None else place.lat_deg,
        lon=None if place is None else place.lon_deg,
        alt_amsl=None if place is None else place.alt_amsl_m,
        cov=upper_triangle(track.cov),
        last_seen_s=s_from_ns(now - track.last_seen_host_ns),
        first_seen_s=s_from_ns(now - track.first_host_ns),
    )


def upper_triangle(cov: Matrix3) -> tuple[float, ...]:
    """The six values of a symmetric matrix, three significant digits each."""
    (nn, ne, nd), (_, ee, ed), (_, _, dd) = cov
    return tuple(float(f"{value:.3g}") for value in (nn, ne, nd, ee, ed, dd))


def _from_vehicle(position: Vector3, situation: Situation) -> Vector3 | None:
    """Vector from the vehicle, NED, metres. Without a global position, tracks start at the point below the camera."""
    vehicle = situation.recent_vehicle
    if vehicle is None:
        return None
    if vehicle.position_ned is not None:
        return subtract(position, vehicle.position_ned)
    if situation.plane is None and vehicle.height_above_home_m is not None:
        return (position[0], position[1], position[2] + vehicle.height_above_home_m)
    return None


def larger_sigma(cov: Matrix3) -> float:
    """One sigma along the larger horizontal semi-axis, metres; NaN where the covariance is not finite."""
    sigma_m = larger_semi_axis(cov)
    return sigma_m if isfinite(cov[0][0] + cov[0][1] + cov[1][1]) else nan


def speed_and_course(track: Track) -> tuple[float, float]:
    """Horizontal speed, m/s, and its direction, radians from north; NaN where the velocity is unknown."""
    if track.velocity_ned is None:
        return (nan, nan)
    north, east, _ = track.velocity_ned
    return (hypot(north, east), atan2(east, north))


def float32(value: float) -> float:
    """Value for a float field; NaN, MAVLink's "unknown", where the field cannot hold it."""
    return value if isfinite(value) and abs(value) <= FLOAT32_MAX else nan


def boot_ms(now: HostNs) -> int:
    """Time since this board's boot for ``time_boot_ms``: milliseconds, modulo 2^32."""
    return now // NS_PER_MS & 0xFFFFFFFF


def degrees_e7(angle_deg: float) -> int:
    """Latitude or longitude for a message, 1e-7 degrees."""
    return round(angle_deg * 1e7)
