"""The lines of a targets file (schema 1), as plain mappings; :func:`encode_line` makes the bytes. PURE."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Vector3, subtract, transform
from fwav_companion.types import ClockEstimate, ErrorBudget, GroundFix, Reason, Sighting, Track
from fwav_companion.types.flight_status import ParameterReport
from fwav_companion.types.tracks import FinalPlace

SCHEMA = 1
Line = Mapping[str, Any]

_encoder = msgspec.json.Encoder()


def encode_line(line: Line) -> bytes:
    """One JSON object and a newline: floats in their shortest exact form, keys in order of insertion."""
    return _encoder.encode(line) + b"\n"


def unix_seconds(host_ns: int, unix_offset_ns: int) -> float:
    """A host instant in seconds on the recording's clock."""
    return (host_ns + unix_offset_ns) / 1e9


def line_unix_s(line: Line, unix_offset_s: float) -> float | None:
    """Time of a line on the recording's clock, seconds; None for lines without a time. The offset is the header's."""
    if line["type"] == "clock":
        time_unix: float = line["time_monotonic"] + unix_offset_s
        return time_unix
    return line.get("time_unix")


def header_line(version: str, origin: Geodetic | None, unix_offset_ns: int, config: Line) -> Line:
    """The first line of a targets file."""
    return {
        "type": "header",
        "schema": SCHEMA,
        "version": version,
        "origin": origin_object(origin),
        "unix_offset_s": unix_offset_ns / 1e9,
        "config": config,
    }


def origin_object(origin: Geodetic | None) -> Line | None:
    """The origin in degrees and metres, or null."""
    if origin is None:
        return None
    return {"lat": origin.lat_deg, "lon": origin.lon_deg, "alt_amsl": origin.alt_amsl_m}


def target_line(track: Track, plane: TangentPlane | None, unix_offset_ns: int) -> Line:
    """State of one live track after one processed frame."""
    place = plane.geodetic_from_ned(track.position_ned) if plane else None
    north, east, down = track.position_ned
    line: dict[str, Any] = {
        "type": "target",
        "time_unix": unix_seconds(track.host_ns, unix_offset_ns),
        "time_boot": track.boot_ns / 1e9,
        "frame": track.frame,
        "track": track.id,
        "label": track.label,
        "state": track.state.value,
    }
    if track.reason is not None:
        line["reason"] = track.reason.value
    if track.replaced_by is not None:
        line["replaced_by"] = track.replaced_by
    line |= {
        "north": north,
        "east": east,
        "down": down,
        "lat": place.lat_deg if place else None,
        "lon": place.lon_deg if place else None,
        "alt_amsl": place.alt_amsl_m if place else None,
        "cov": track.cov,
        "vel": track.velocity_ned,
        "vel_cov": track.velocity_cov,
        "relative": _relative_object(track),
        "fix": _fix_object(track.fix),
    }
    if track.innovation is not None:
        of = track.innovation
        line["innovation"] = {"north": of.north_m, "east": of.east_m, "distance2": of.nis}
    return line


def final_places(places: Mapping[int, FinalPlace], ends: Mapping[int, Line], plane: TangentPlane | None) -> list[Line]:
    """The summary's ``final``: targets by the whole flight, with label and height of their last line in flight."""
    found: list[Line] = []
    for number, final in sorted(places.items()):
        end = ends.get(number)
        if end is None:
            continue
        place = plane.geodetic_from_ned((final.north, final.east, end["down"])) if plane else None
        (nn, ne), (_, ee) = final.cov
        found.append(
            {
                "track": number,
                "label": end["label"],
                "north": final.north,
                "east": final.east,
                "down": end["down"],
                "lat": place.lat_deg if place else None,
                "lon": place.lon_deg if place else None,
                "alt_amsl": place.alt_amsl_m if place else None,
                "cov": ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, end["cov"][2][2])),
                "sightings": final.sightings,
            }
        )
    return found


def _relative_object(track: Track) -> Line | None:
    """The target relative to the vehicle; None where the vehicle's position is not known."""
    if track.vehicle_ned is None:
        return None
    north, east, down = subtract(track.apparent_ned, track.vehicle_ned)
    return {"north": north, "east": east, "down": down, "cov": track.relative_cov}


def _fix_object(fix: GroundFix | None) -> Line | None:
    if fix is None:
        return None
    north, east, down = fix.position_ned
    return {"north": north, "east": east, "down": down, "cov": fix.cov}


def sighting_line(
    frame: int | None,
    index: int,
    sighting: Sighting | None,
    fix: GroundFix | None,
    reason: Reason | None,
    gap_s: float | None,
) -> Line:
    """One detection, used or not. Unknown values are null."""
    state = sighting.state if sighting else None
    return {
        "type": "sighting",
        "frame": frame,
        "index": index,
        "time_boot": state.boot_ns / 1e9 if state else None,
        "ray_ned": transform(sighting.ned_from_camera, sighting.ray.direction) if sighting else None,
        "camera_ned": sighting.camera_ned if sighting else None,
        "q_ned_body": state.ned_from_body if state else None,
        **({"q_ned_gimbal": state.ned_from_carrier} if state and state.gimbal is not None else {}),
        "gap_s": state.gap_s if state else gap_s,
        "reason": reason.value if reason else None,
        "budget": _budget_object(fix.budget) if fix else None,
        "ground_ned": fix.position_ned if fix else None,
        "noise_cov": fix.noise_cov if fix else None,
    }


def _budget_object(budget: ErrorBudget) -> Line:
    """The error budget by cause; the height of a standing target only where the target has one."""
    line = {name: getattr(budget, name) for name in budget.__struct_fields__}
    if budget.target == 0.0:
        del line["target"]
    return line


def clock_line(now_ns: HostNs, estimate: ClockEstimate, time_boot_ns: int, utc_minus_unix_s: float | None) -> Line:
    """State of the clock, written once a second."""
    return {
        "type": "clock",
        "time_monotonic": now_ns / 1e9,
        "time_boot": time_boot_ns / 1e9,
        "host_from_autopilot_s": estimate.host_from_autopilot_ns / 1e9,
        "sigma_s": estimate.sigma_s,
        "bound_s": estimate.bound_s,
        "round_trip_s": estimate.round_trip_s,
        "rate": estimate.rate,
        "utc_minus_time_unix_s": utc_minus_unix_s,
        "status": estimate.status.value,
    }


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
) -> Line:
    """Estimates of self-calibration, written about once a second.

    ``reason``: what is missing, null when calibrated; ``mistake``: a gross error of the mount. ``parameters``: status
    of each.
    """
    line: dict[str, Any] = {
        "type": "calibration",
        "time_unix": time_unix,
        "time_offset_s": time_offset_s,
        "time_offset_sigma_s": time_offset_sigma_s,
        "mount_deg": [degrees(angle) for angle in mount],
        "mount_sigma_deg": [degrees(angle) for angle in mount_sigma],
        "status": status,
        "reason": reason,
    }
    if parameters:
        line["parameters"] = [msgspec.to_builtins(each) for each in parameters]
    return {**line, "mistake": mistake} if mistake else line


def terrain_line(time_unix: float, shift_m: float, sigma_m: float, source: str) -> Line:
    """A shift of the elevation model to the take-off height."""
    return {"type": "terrain", "time_unix": time_unix, "shift_m": shift_m, "sigma_m": sigma_m, "source": source}


def home_line(time_unix: float, home_down_m: float) -> Line:
    """A change of the home surface."""
    return {"type": "home", "time_unix": time_unix, "down": home_down_m}


def origin_line(time_unix: float, origin: Geodetic) -> Line:
    """The place of NED's zero, if it became known after the header was written, and where a global position is lost or
    comes back. Its north is the autopilot's.
    """
    place = origin_object(origin)
    return {"type": "origin", "time_unix": time_unix, "origin": place, **(place or {}), "yaw_deg": 0.0}
