"""Messages for ground stations that are not the camera's, field by field. Pure.

NAMED_VALUE_FLOAT (251): the selected target as numbers, for Mission Planner's quick view. ADSB_VEHICLE (246): a map
marker for stations without another one, on gcs links only, because an autopilot takes it for traffic and avoids it.
ONBOARD_COMPUTER_STATUS (390): load, memory, temperature and links of the companion computer.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isfinite, nan
from typing import Any

from fwav_companion.geometry.ellipses import radius_95
from fwav_companion.geometry.stamps import NS_PER_US, HostNs
from fwav_companion.publishing import enums
from fwav_companion.publishing.target_report import boot_ms, degrees_e7, float32, speed_and_course, target_report
from fwav_companion.types.board import BoardReport
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track

NAMES = ("TGT_ID", "TGT_N", "TGT_E", "TGT_DIST", "TGT_BRG", "TGT_ACC", "TGT_R95")
"""Names of the selected target's values; the message holds ten characters."""

ADDRESSES = 0xF00000
"""First ICAO address that is not allotted to a country."""
CALLSIGN_CHARACTERS = 8

ONBOARD_COMPUTER_STATUS = 390
UNUSED_8, UNUSED_32 = 0xFF, 0xFFFFFFFF
UNUSED_CELSIUS, UNUSED_RPM = 127, 32767
"""Values of the definition for an unused field."""
UART, WIRED_NETWORK = 0, 10
"""Values of link_type. Whether a network is wired is not known here."""


def named_values(track: Track | None, situation: Situation) -> list[dict[str, Any]]:
    """Fields of one message for each of :data:`NAMES`.

    The values are: number of the track, metres north and east of the origin, distance from the vehicle in metres,
    bearing in degrees from north, one sigma along the larger semi-axis and radius of the 95 % circle in metres. Without
    a target the number is 0 and the other values are NaN.
    """
    values = (0.0, *(nan,) * (len(NAMES) - 1)) if track is None else _values(track, situation)
    stamp = boot_ms(situation.now_ns)
    return [
        {"time_boot_ms": stamp, "name": name, "value": float32(value)}
        for name, value in zip(NAMES, values, strict=True)
    ]


def adsb_vehicle(track: Track, system: int, now: Situation) -> dict[str, Any] | None:
    """Fields of ADSB_VEHICLE; None without a global position. A track keeps its address."""
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


def onboard_computer_status(board: BoardReport, now: HostNs) -> dict[str, Any]:
    """Fields of ONBOARD_COMPUTER_STATUS; its lists contain the first cores and links in order."""
    celsius = board.core_celsius
    return {
        "time_usec": now // NS_PER_US,
        "uptime": boot_ms(now),
        "type": 0,
        "cpu_cores": _list([_percent(share) for share in board.cpu], 8, UNUSED_8),
        "cpu_combined": _list([], 10, UNUSED_8),
        "gpu_cores": _list([], 4, UNUSED_8),
        "gpu_combined": _list([], 10, UNUSED_8),
        "temperature_board": UNUSED_CELSIUS,
        "temperature_core": _list([] if celsius is None else [_celsius(celsius)], 8, UNUSED_CELSIUS),
        "fan_speed": _list([], 4, UNUSED_RPM),
        "ram_usage": _uint32(board.ram_used_mib),
        "ram_total": _uint32(board.ram_total_mib),
        "storage_type": _list([], 4, UNUSED_32),
        "storage_usage": _list([], 4, UNUSED_32),
        "storage_total": _list([], 4, UNUSED_32),
        "link_type": _list([UART if link.serial else WIRED_NETWORK for link in board.links], 6, UNUSED_32),
        "link_tx_rate": _list([_uint32(link.sent_kib_s) for link in board.links], 6, UNUSED_32),
        "link_rx_rate": _list([_uint32(link.received_kib_s) for link in board.links], 6, UNUSED_32),
        "link_tx_max": _list([], 6, UNUSED_32),
        "link_rx_max": _list([], 6, UNUSED_32),
    }


def requested_board_status(situation: Situation) -> dict[str, Any] | None:
    """ONBOARD_COMPUTER_STATUS on request; None before the first report of the board."""
    return None if situation.board is None else onboard_computer_status(situation.board, situation.now_ns)


def _values(track: Track, situation: Situation) -> tuple[float, ...]:
    target = target_report(track, situation)
    return (
        float(track.id),
        target.position_ned[0],
        target.position_ned[1],
        target.distance_m,
        degrees(target.bearing) % 360.0,
        target.horizontal_sigma_m,
        radius_95(track.cov),
    )


def _callsign(track: Track) -> str:
    """Letters and digits of the label with the track's number, at most eight characters."""
    number = str(track.id)[-3:]
    name = "".join(one for one in track.label.upper() if one.isascii() and one.isalnum()) or "TGT"
    return name[: CALLSIGN_CHARACTERS - len(number)] + number


def _list(values: Sequence[int], length: int, unused: int) -> tuple[int, ...]:
    return (*values[:length], *(unused,) * (length - len(values)))


def _percent(share: float) -> int:
    return round(100.0 * min(max(share, 0.0), 1.0)) if isfinite(share) else UNUSED_8


def _celsius(celsius: float) -> int:
    return min(max(round(celsius), -128), UNUSED_CELSIUS - 1) if isfinite(celsius) else UNUSED_CELSIUS


def _uint32(value: float | None) -> int:
    return UNUSED_32 if value is None or not 0.0 <= value < UNUSED_32 else round(value)
