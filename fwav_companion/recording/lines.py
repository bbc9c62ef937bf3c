"""Builds the lines of a targets file from the results of the pipeline; :func:`encode_line` makes the bytes. PURE."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Vector3, subtract, transform
from fwav_companion.recording.line_types import (
    CalibrationLine,
    ClockEstimateLine,
    HeaderLine,
    InnovationObject,
    Line,
    OriginLine,
    OriginObject,
    PlaceObject,
    SightingLine,
    TargetLine,
)
from fwav_companion.recording.summary_types import FinalObject
from fwav_companion.types import ClockEstimate, GroundFix, Reason, Sighting, Track
from fwav_companion.types.flight_status import ParameterReport
from fwav_companion.types.tracks import FinalPlace

_encoder = msgspec.json.Encoder()


def encode_line(line: Line) -> bytes:
    """One JSON object and a newline: floats in their shortest exact form, keys in order of the fields."""
    return _encoder.encode(line) + b"\n"


def unix_seconds(host_ns: int, unix_offset_ns: int) -> float:
    """A host instant in seconds on the recording's clock."""
    return (host_ns + unix_offset_ns) / 1e9


def header_line(version: str, origin: Geodetic | None, unix_offset_ns: int, config: Mapping[str, Any]) -> HeaderLine:
    """The first line of a targets file."""
    return HeaderLine(
        version=version,
        origin=None if origin is None else origin_object(origin),
        unix_offset_s=unix_offset_ns / 1e9,
        config=config,
    )


def origin_object(origin: Geodetic) -> OriginObject:
    """The origin in degrees and metres."""
    return OriginObject(origin.lat_deg, origin.lon_deg, origin.alt_amsl_m)


def target_line(track: Track, plane: TangentPlane | None, unix_offset_ns: int) -> TargetLine:
    """State of one live track after one processed frame."""
    place = plane.geodetic_from_ned(track.position_ned) if plane else None
    north, east, down = track.position_ned
    return TargetLine(
        time_unix=unix_seconds(track.host_ns, unix_offset_ns),
        time_boot=track.boot_ns / 1e9,
        frame=track.frame,
        track=track.id,
        label=track.label,
        state=track.state,
        reason=None if track.reason is None else track.reason.value,
        replaced_by=track.replaced_by,
        north=north,
        east=east,
        down=down,
        lat=place.lat_deg if place else None,
        lon=place.lon_deg if place else None,
        alt_amsl=place.alt_amsl_m if place else None,
        cov=track.cov,
        vel=track.velocity_ned,
        vel_cov=track.velocity_cov,
        relative=_relative_object(track),
        fix=_fix_object(track.fix),
        innovation=_innovation_object(track),
    )


def final_places(
    places: Mapping[int, FinalPlace], ends: Mapping[int, TargetLine], plane: TangentPlane | None
) -> list[FinalObject]:
    """The summary's ``final``: targets by the whole flight, with label and height of their last line in flight."""
    found: list[FinalObject] = []
    for number, final in sorted(places.items()):
        end = ends.get(number)
        if end is None:
            continue
        place = plane.geodetic_from_ned((final.north, final.east, end.down)) if plane else None
        (nn, ne), (_, ee) = final.cov
        found.append(
            FinalObject(
                track=number,
                label=end.label,
                north=final.north,
                east=final.east,
                down=end.down,
                lat=place.lat_deg if place else None,
                lon=place.lon_deg if place else None,
                alt_amsl=place.alt_amsl_m if place else None,
                cov=((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, end.cov[2][2])),
                sightings=final.sightings,
            )
        )
    return found


def _relative_object(track: Track) -> PlaceObject | None:
    """The target relative to the vehicle; None where the vehicle's position is not known."""
    if track.vehicle_ned is None:
        return None
    north, east, down = subtract(track.apparent_ned, track.vehicle_ned)
    return PlaceObject(north=north, east=east, down=down, cov=track.relative_cov)


def _fix_object(fix: GroundFix | None) -> PlaceObject | None:
    if fix is None:
        return None
    north, east, down = fix.position_ned
    return PlaceObject(north=north, east=east, down=down, cov=fix.cov)


def _innovation_object(track: Track) -> InnovationObject | None:
    found = track.innovation
    return None if found is None else InnovationObject(north=found.north_m, east=found.east_m, distance2=found.nis)


def sighting_line(
    frame: int | None,
    index: int,
    sighting: Sighting | None,
    fix: GroundFix | None,
    reason: Reason | None,
    gap_s: float | None,
) -> SightingLine:
    """One detection, used or not. Unknown values are null."""
    state = sighting.state if sighting else None
    return SightingLine(
        frame=frame,
        index=index,
        time_boot=state.boot_ns / 1e9 if state else None,
        ray_ned=transform(sighting.ned_from_camera, sighting.ray.direction) if sighting else None,
        camera_ned=sighting.camera_ned if sighting else None,
        q_ned_body=state.ned_from_body if state else None,
        q_ned_gimbal=state.ned_from_carrier if state and state.gimbal is not None else None,
        gap_s=state.gap_s if state else gap_s,
        reason=reason.value if reason else None,
        budget=fix.budget if fix else None,
        ground_ned=fix.position_ned if fix else None,
        noise_cov=fix.noise_cov if fix else None,
    )


def clock_line(
    now_ns: HostNs, estimate: ClockEstimate, time_boot_ns: int, utc_minus_unix_s: float | None
) -> ClockEstimateLine:
    """State of the clock, written once a second."""
    return ClockEstimateLine(
        time_monotonic=now_ns / 1e9,
        time_boot=time_boot_ns / 1e9,
        host_from_autopilot_s=estimate.host_from_autopilot_ns / 1e9,
        sigma_s=estimate.sigma_s,
        bound_s=estimate.bound_s,
        round_trip_s=estimate.round_trip_s,
        rate=estimate.rate,
        utc_minus_time_unix_s=utc_minus_unix_s,
        status=estimate.status.value,
    )


def calibration_line(
    time_unix: float,
    time_offset_s: float,
    time_offset_sigma_s: float,
    mount: Vector3,
    mount_sigma: Vector3,
    status: str,
    reason: str | None,
    mistake: str = "",
    parameters: Sequence[ParameterReport] = (),
) -> CalibrationLine:
    """Estimates of self-calibration, written about once a second.

    ``reason``: what is missing, null when calibrated; ``mistake``: a gross error of the mount. ``parameters``: status
    of each.
    """
    return CalibrationLine(
        time_unix=time_unix,
        time_offset_s=time_offset_s,
        time_offset_sigma_s=time_offset_sigma_s,
        mount_deg=_degrees(mount),
        mount_sigma_deg=_degrees(mount_sigma),
        status=status,
        reason=reason,
        parameters=tuple(parameters),
        mistake=mistake,
    )


def _degrees(vector: Vector3) -> Vector3:
    x, y, z = vector
    return degrees(x), degrees(y), degrees(z)


def origin_line(time_unix: float, origin: Geodetic) -> OriginLine:
    """The place of NED's zero, if it became known after the header was written, and where a global position is lost or
    comes back. Its north is the autopilot's.
    """
    place = origin_object(origin)
    return OriginLine(
        time_unix=time_unix, origin=place, lat=place.lat, lon=place.lon, alt_amsl=place.alt_amsl, yaw_deg=0.0
    )
