"""ADSB_VEHICLE (246) as a map marker, for ground stations that show nothing else.

Only ever on gcs links: an autopilot takes it for traffic, and avoids it.
"""

from __future__ import annotations

from math import degrees, isfinite
from typing import Any

from fwav_companion.publishing import enums
from fwav_companion.publishing.target_report import degrees_e7, speed_and_course, target_report
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track

ADDRESSES = 0xF00000
"""ICAO has allotted no country the addresses from here on."""
CALLSIGN_CHARACTERS = 8


def adsb_vehicle(track: Track, system: int, now: Situation) -> dict[str, Any] | None:
    """The fields; None without a global position. The same track keeps the same address."""
    target = target_report(track, now)
    if target.place is None:
        return None
    speed, course = speed_and_course(track)
    moving = isfinite(speed)
    flags = enums.ADSB_FLAGS_VALID_COORDS | enums.ADSB_FLAGS_VALID_ALTITUDE | enums.ADSB_FLAGS_VALID_CALLSIGN
    if moving:
        flags |= enums.ADSB_FLAGS_VALID_HEADING | enums.ADSB_FLAGS_VALID_VELOCITY
    return {
        "ICAO_address": ADDRESSES | (system & 0xFF) << 12 | track.id & 0xFFF,
        "lat": degrees_e7(target.place.lat_deg),
        "lon": degrees_e7(target.place.lon_deg),
        "altitude_type": enums.ADSB_ALTITUDE_TYPE_GEOMETRIC,
        "altitude": round(min(max(target.place.alt_amsl_m, -2e6), 2e6) * 1000.0),
        "heading": round(degrees(course) % 360.0 * 100.0) % 36000 if moving else 0,
        "hor_velocity": min(round(speed * 100.0), 0xFFFF) if moving else 0,
        "ver_velocity": 0,
        "callsign": _callsign(track),
        "emitter_type": enums.ADSB_EMITTER_TYPE_POINT_OBSTACLE,
        "tslc": min(max(0, now.now_ns - track.last_seen_host_ns) // 1_000_000_000, 0xFF),
        "flags": flags,
        "squawk": 0,
    }


def _callsign(track: Track) -> str:
    """Letters and digits of the label with the track's number, within eight characters."""
    number = str(track.id)[-3:]
    name = "".join(one for one in track.label.upper() if one.isascii() and one.isalnum()) or "TGT"
    return name[: CALLSIGN_CHARACTERS - len(number)] + number
