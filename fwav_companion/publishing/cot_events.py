"""Events of the vehicle, of the camera's view and of the targets, from tracks and the vehicle's state. Pure."""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, degrees, hypot, isfinite
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.ellipses import NORMAL_95, circle_radius
from fwav_companion.geometry.stamps import HostNs, ns_from_s
from fwav_companion.geometry.vectors import Vector3, norm, subtract
from fwav_companion.publishing.cot import (
    MACHINE,
    MAX_UTC_NS,
    SPI_HOW,
    SPI_KIND,
    UNKNOWN,
    Detail,
    MapEvent,
    clock_text,
)  # fmt: skip
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.publishing.target_report import target_report
from fwav_companion.types.messages import NoticeCode
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track

UAV, FIXED_WING, ROTARY_WING, GROUND_VEHICLE, BOAT = "a-f-A-M", "a-f-A-M-F-Q", "a-f-A-M-H-Q", "a-f-G-E-V", "a-f-S"
KIND_BY_TYPE = (
    dict.fromkeys((1, 16, 19, 20, 21, 22, 23, 24, 25), FIXED_WING)
    | dict.fromkeys((2, 3, 4, 13, 14, 15, 29, 35), ROTARY_WING)
    | {10: GROUND_VEHICLE, 11: BOAT}
)
"""CoT type by MAV_TYPE: wings, also flapping and VTOL ones; rotors; rover; boat."""
MAX_RANGE_M = 15_000.0
"""Longest range of a sensor that ATAK draws."""
VIEW_COLOUR = {"fovAlpha": "0.3", "fovRed": "1.0", "fovGreen": "0.6", "fovBlue": "0.0"}

GeoidHeight: TypeAlias = Callable[[float, float], float]
"""(latitude, longitude), degrees -> height of the geoid above the ellipsoid, metres."""


class CameraAim(msgspec.Struct, frozen=True):
    """Where the camera looks at one instant."""

    axis_ned: Vector3
    """Optical axis, NED, unit vector."""
    place_ned: Vector3 | None
    """Ground on the axis, local NED, metres; None where the axis meets none."""
    horizontal_sigma_m: float
    """One sigma of that place, larger semi-axis, metres; NaN without one."""


LookAt: TypeAlias = Callable[[HostNs], CameraAim | None]
"""Where the camera looks at an instant; None where its attitude is not known."""


class EventMaker(msgspec.Struct, frozen=True):
    """Makes the events of one vehicle. The uids name the board and the vehicle, so that they survive a restart."""

    options: PublishOptions
    geoid: GeoidHeight | None = None
    """Used where the autopilot gives no ellipsoid height; without it such heights are unknown."""

    def utc_ns(self, situation: Situation) -> int | NoticeCode:
        """UTC now, Unix nanoseconds, or why no event can be made."""
        if situation.plane is None:
            return NoticeCode.COT_WITHOUT_POSITION
        if situation.utc_minus_host_s is None:
            return NoticeCode.COT_WITHOUT_UTC
        utc_ns = situation.now_ns + ns_from_s(situation.utc_minus_host_s)
        return utc_ns if 0 <= utc_ns < MAX_UTC_NS else NoticeCode.COT_WITHOUT_UTC

    def prefix(self, situation: Situation) -> str:
        """The part of every uid that names this board and this vehicle."""
        system = situation.autopilot.system if situation.autopilot is not None else 0
        return f"fwav-companion.{self.options.unit or 'fwav'}.{system}"

    def target(self, track: Track, uid: str, situation: Situation, utc_ns: int) -> MapEvent | None:
        """A target, valid for ``cot_target_stale_s`` after its last fix; None without a global position."""
        target = target_report(track, situation)
        if target.place is None:
            return None
        seen_ns = utc_ns - max(0, situation.now_ns - track.last_seen_host_ns)
        label = track.label or "target"
        return MapEvent(
            uid=uid,
            kind=self.options.cot_type,
            utc_ns=utc_ns,
            stale_s=max(0.0, self.options.cot_target_stale_s - (utc_ns - seen_ns) / 1e9),
            lat_deg=target.place.lat_deg,
            lon_deg=target.place.lon_deg,
            hae_m=self._hae_m(target.place, situation),
            horizontal_sigma_m=target.horizontal_sigma_m,
            vertical_sigma_m=target.vertical_sigma_m,
            callsign=f"{label} {track.id}",
            remarks=f"last seen {clock_text(seen_ns)} UTC; {_accuracy(track, target.vertical_sigma_m)}; "
            f"track {track.id}, {label}, {track.state}; ce and le are one sigma",
        )

    def vehicle(self, aim: CameraAim | None, situation: Situation, utc_ns: int) -> MapEvent | None:
        """The vehicle with its camera's view at the instant of its newest attitude, from which its validity counts.

        None while its position is not known, and once it is stale: an old place must not be sent as a new one.
        """
        state, plane = situation.vehicle, situation.plane
        if state is None or plane is None or state.position_ned is None:
            return None
        age_ns = situation.now_ns - situation.host_ns_of(state)
        if age_ns >= ns_from_s(self.options.cot_stale_s):
            return None
        place = plane.geodetic_from_ned(state.position_ned)
        system = 0 if situation.autopilot is None else situation.autopilot.system
        kind = UAV if situation.autopilot is None else KIND_BY_TYPE.get(situation.autopilot.vehicle_type, UAV)
        return MapEvent(
            uid=f"{self.prefix(situation)}.vehicle",
            kind=kind,
            how=MACHINE,
            utc_ns=utc_ns - age_ns,
            stale_s=self.options.cot_stale_s,
            lat_deg=place.lat_deg,
            lon_deg=place.lon_deg,
            hae_m=self._hae_m(place, situation),
            callsign=f"{self.options.cot_callsign or 'UAV'} {system}",
            details=(*_track(state.velocity_ned), *self._sensor(aim, state.position_ned)),
        )

    def spi(self, aim: CameraAim | None, vehicle: MapEvent, situation: Situation) -> MapEvent | None:
        """The point that the camera looks at, linked to the vehicle's event; None where the axis meets no ground."""
        if aim is None or aim.place_ned is None or situation.plane is None:
            return None
        place = situation.plane.geodetic_from_ned(aim.place_ned)
        return MapEvent(
            uid=f"{self.prefix(situation)}.spi",
            kind=SPI_KIND,
            how=SPI_HOW,
            utc_ns=vehicle.utc_ns,
            stale_s=self.options.cot_stale_s,
            lat_deg=place.lat_deg,
            lon_deg=place.lon_deg,
            hae_m=self._hae_m(place, situation),
            horizontal_sigma_m=aim.horizontal_sigma_m,
            callsign=f"{vehicle.callsign} looks here",
            details=(("link", {"uid": vehicle.uid, "type": vehicle.kind, "relation": "p-p"}),),
        )

    def _hae_m(self, place: Geodetic, situation: Situation) -> float:
        """Height above the ellipsoid: h = H + N, N by the autopilot's receiver, else by the geoid that ships."""
        if situation.undulation_m is not None:
            return place.alt_amsl_m + situation.undulation_m
        if self.geoid is not None:
            return place.alt_amsl_m + self.geoid(place.lat_deg, place.lon_deg)
        return UNKNOWN

    def _sensor(self, aim: CameraAim | None, vehicle_ned: Vector3) -> tuple[Detail, ...]:
        """The camera's view. ATAK draws it only with azimuth, fov and range, and rounds these to integers."""
        if aim is None or self.options.hfov_deg <= 0.0:
            return ()
        north, east, down = aim.axis_ned
        range_m = MAX_RANGE_M if aim.place_ned is None else norm(subtract(aim.place_ned, vehicle_ned))
        values = {
            "azimuth": f"{degrees(atan2(east, north)) % 360.0:.1f}",
            "elevation": f"{degrees(atan2(-down, hypot(north, east))):.1f}",
            "fov": f"{self.options.hfov_deg:.1f}",
            "vfov": f"{self.options.vfov_deg:.1f}",
            "range": f"{min(range_m, MAX_RANGE_M):.1f}",
            "displayMagneticReference": "0",
            **VIEW_COLOUR,
        }
        return (("sensor", values),)


def _track(velocity_ned: Vector3 | None) -> tuple[Detail, ...]:
    """Course and speed over ground."""
    if velocity_ned is None:
        return ()
    north, east, _ = velocity_ned
    course_deg = degrees(atan2(east, north)) % 360.0
    return (("track", {"course": f"{course_deg:.1f}", "speed": f"{hypot(north, east):.2f}"}),)


def _accuracy(track: Track, vertical_sigma_m: float) -> str:
    """The accuracy in words."""
    radius_m = circle_radius(track.cov, 0.95) if isfinite(track.cov[0][0] + track.cov[0][1] + track.cov[1][1]) else None
    if radius_m is None or not isfinite(vertical_sigma_m):
        return "accuracy unknown"
    return f"within {radius_m:.1f} m, height within {NORMAL_95 * vertical_sigma_m:.1f} m (95 % each)"
