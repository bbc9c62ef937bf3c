"""MISB ST 0601 metadata (KLV) of a video: where the sensor is and how it looks. PURE.

A packet is the 16-byte key, a BER length, then items of tag (BER-OID), BER length and big-endian value; the checksum is
the last item. The key is searched for: synchronous carriage puts a header of its own before each packet, and encoders
differ. Signed items have their lowest value for "unknown" (ST 0601.8, "out of range").
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from enum import StrEnum
from math import cos, degrees, radians, sin
from statistics import median
from typing import Final

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.rotations import euler_from_quaternion, multiply, quaternion_from_euler
from fwav_companion.photographs.picture_pose import AltDatum
from fwav_companion.photographs.telemetry_rows import TelemetryRow, focal_of_field, is_place

KEY: Final = bytes.fromhex("060E2B34020B01010E01030101000000")
CHECKSUM: Final = 1
LARGEST_PACKET: Final = 1 << 16
TIME, TIME_BYTES = 2, 8
LEAP_SECONDS: Final = 136
LEAP_S_SINCE_2017: Final = 37
"""TAI minus UTC since 2017-01-01; no further leap second is announced (IERS Bulletin C)."""
SINCE_2017_S: Final = 1_483_228_837.0
"""2017-01-01 UTC in MISP time."""
(PLATFORM_HEADING, PLATFORM_PITCH, PLATFORM_ROLL, LAT, LON, ALTITUDE, FIELD, AZIMUTH, ELEVATION, ROLL, CENTRE_LAT,
 CENTRE_LON, CENTRE_ALTITUDE, ELLIPSOID, FULL_PITCH, FULL_ROLL, LONG_ELLIPSOID) = (
    5, 6, 7, 13, 14, 15, 16, 18, 19, 20, 23, 24, 25, 75, 90, 91, 104)  # fmt: skip


class TimeScale(StrEnum):
    """What item 2 counts."""

    AUTO = "auto"
    """MISP time where the leap seconds (item 136) come with it, else UTC, as older and smaller encoders write it."""
    UTC = "utc"
    MISP = "misp"
    """Atomic seconds since 1970 (ST 0603): UTC plus the leap seconds."""


class SensorState(msgspec.Struct, frozen=True, kw_only=True):
    """What a packet says; None for what it does not."""

    lat_deg: float | None
    lon_deg: float | None
    amsl_m: float | None
    """Above mean sea level."""
    ellipsoid_m: float | None
    angles_deg: tuple[float, float, float] | None
    """Roll, pitch and yaw of the camera from the horizon and true north: platform's and sensor's together."""
    hfov_deg: float | None
    centre: tuple[float, float, float] | None
    """Latitude, longitude and altitude (above sea level) of the frame's centre, by the encoder's own computation."""
    time_s: float | None = None
    """Item 2, on the scale that the encoder chose."""
    leap_s: int | None = None
    """Item 136: what to take from ``time_s`` for UTC."""

    def unix_time(self, scale: TimeScale) -> float | None:
        """UTC; None without a time, or in MISP time from before 2017 without its leap seconds."""
        if self.time_s is None or scale is TimeScale.UTC or (scale is TimeScale.AUTO and self.leap_s is None):
            return self.time_s
        if self.leap_s is None and self.time_s < SINCE_2017_S:
            return None
        return self.time_s - (LEAP_S_SINCE_2017 if self.leap_s is None else self.leap_s)


def decode_packets(data: bytes) -> Iterator[SensorState]:
    """The states of the complete packets with a good checksum, in their order."""
    at = 0
    while (at := data.find(KEY, at)) >= 0:
        begin = _length(data, at + len(KEY))
        if begin is None or begin[1] > LARGEST_PACKET or begin[0] + begin[1] > len(data):
            at += 1
            continue
        first, size = begin
        packet = data[at : first + size]
        values = _items(packet, first - at)
        if values is None:
            at += 1
            continue
        yield _state(values)
        at = first + size


def row_of(state: SensorState, at_s: float, scale: TimeScale = TimeScale.AUTO) -> TelemetryRow | None:
    """The state as telemetry at a time of the video; None without a place."""
    if not is_place(state.lat_deg, state.lon_deg):
        return None
    on_ellipsoid = state.ellipsoid_m is not None
    altitude = state.ellipsoid_m if on_ellipsoid else state.amsl_m
    return TelemetryRow(
        at_s=at_s,
        until_s=at_s,
        lat_deg=state.lat_deg,
        lon_deg=state.lon_deg,
        absolute_m=altitude,
        absolute_datum=None if altitude is None else AltDatum.ELLIPSOID if on_ellipsoid else AltDatum.EGM96,
        angles_deg=state.angles_deg,
        focal_35mm=focal_of_field(state.hfov_deg),
        time_unix=state.unix_time(scale),
    )


def centre_residual_m(state: SensorState) -> float | None:
    """Distance of the frame's centre from the ray of the camera's axis, metres: shows angles in another convention."""
    if state.centre is None or state.angles_deg is None or state.lat_deg is None or state.lon_deg is None:
        return None
    height = state.amsl_m if state.amsl_m is not None else state.ellipsoid_m
    if height is None:
        return None
    plane = TangentPlane(Geodetic.from_degrees(state.lat_deg, state.lon_deg, height))
    north, east, down = plane.ned_from_geodetic(Geodetic.from_degrees(*state.centre))
    _, pitch, yaw = map(radians, state.angles_deg)
    ahead = (cos(pitch) * cos(yaw), cos(pitch) * sin(yaw), -sin(pitch))
    along = north * ahead[0] + east * ahead[1] + down * ahead[2]
    return float(sum((a - along * b) ** 2 for a, b in zip((north, east, down), ahead, strict=True)) ** 0.5)


def centre_notes(states: Sequence[SensorState]) -> tuple[str, ...]:
    """The median distance of the frames' centres from the camera's axis, where the encoder wrote them."""
    residuals = [value for state in states if (value := centre_residual_m(state)) is not None]
    if not residuals:
        return ()
    middle = median(residuals)
    return (f"the frame centres in the metadata lie {middle:.0f} m (median) from the camera's axis",)


def _items(packet: bytes, at: int) -> dict[int, bytes] | None:
    """The items by their tags; None where lengths or checksum are wrong."""
    values: dict[int, bytes] = {}
    while at < len(packet):
        tag, at = _tag(packet, at)
        found = _length(packet, at)
        if found is None or found[0] + found[1] > len(packet):
            return None
        start, size = found
        if tag == CHECKSUM:
            good = size == 2 and _sum(packet[:start]) == int.from_bytes(packet[start : start + 2], "big")
            return values if good and start + 2 == len(packet) else None
        values[tag] = packet[start : start + size]
        at = start + size
    return None


def _sum(data: bytes) -> int:
    """ST 0601's running 16-bit sum: bytes at even offsets are the high ones."""
    return ((sum(data[::2]) << 8) + sum(data[1::2])) & 0xFFFF


def _tag(data: bytes, at: int) -> tuple[int, int]:
    """A BER-OID number and the offset after it."""
    tag = 0
    while at < len(data):
        tag, at = tag << 7 | data[at] & 0x7F, at + 1
        if not data[at - 1] & 0x80:
            break
    return tag, at


def _length(data: bytes, at: int) -> tuple[int, int] | None:
    """(offset of the value, its length) by BER; None where it is cut off or longer than any packet."""
    if at >= len(data):
        return None
    if data[at] < 0x80:
        return at + 1, data[at]
    count = data[at] & 0x7F
    if not 0 < count <= 4 or at + 1 + count > len(data):
        return None
    return at + 1 + count, int.from_bytes(data[at + 1 : at + 1 + count], "big")


def _signed(span: float, size: int) -> Callable[[bytes], float | None]:
    """-span to span on a signed integer whose lowest value is unknown."""

    def decoded(value: bytes) -> float | None:
        raw = int.from_bytes(value, "big", signed=True)
        largest = (1 << (8 * size - 1)) - 1
        return None if len(value) != size or raw == -largest - 1 else raw * span / largest

    return decoded


def _unsigned(low: float, high: float, size: int) -> Callable[[bytes], float | None]:
    def decoded(value: bytes) -> float | None:
        return None if len(value) != size else low + int.from_bytes(value, "big") * (high - low) / ((1 << 8 * size) - 1)

    return decoded


def _imapb_height(value: bytes) -> float | None:
    """IMAPB(-900, 40000) of any length (ST 1201): a power of two a step; the highest bit marks special values."""
    if not 0 < len(value) <= 8 or (value[0] & 0x80 and any(value[1:])):
        return None
    exponent = (40_900 - 1).bit_length() - (8 * len(value) - 1)
    return -900.0 + int.from_bytes(value, "big") * 2.0**exponent


HEIGHT: Final = _unsigned(-900.0, 19_000.0, 2)
DECODERS: Final = {
    PLATFORM_HEADING: _unsigned(0.0, 360.0, 2), PLATFORM_PITCH: _signed(20.0, 2), PLATFORM_ROLL: _signed(50.0, 2),
    LAT: _signed(90.0, 4), LON: _signed(180.0, 4), ALTITUDE: HEIGHT, FIELD: _unsigned(0.0, 180.0, 2),
    AZIMUTH: _unsigned(0.0, 360.0, 4), ELEVATION: _signed(180.0, 4), ROLL: _unsigned(0.0, 360.0, 4),
    CENTRE_LAT: _signed(90.0, 4), CENTRE_LON: _signed(180.0, 4), CENTRE_ALTITUDE: HEIGHT, ELLIPSOID: HEIGHT,
    FULL_PITCH: _signed(90.0, 4), FULL_ROLL: _signed(90.0, 4), LONG_ELLIPSOID: _imapb_height,
}  # fmt: skip


def _state(values: dict[int, bytes]) -> SensorState:
    def of(*tags: int) -> float | None:
        decoded = (DECODERS[tag](values[tag]) for tag in tags if tag in values)
        return next((value for value in decoded if value is not None), None)

    leaps = values.get(LEAP_SECONDS, b"")
    centre = of(CENTRE_LAT), of(CENTRE_LON), of(CENTRE_ALTITUDE)
    return SensorState(
        lat_deg=of(LAT),
        lon_deg=of(LON),
        amsl_m=of(ALTITUDE),
        ellipsoid_m=of(LONG_ELLIPSOID, ELLIPSOID),
        angles_deg=_angles(
            (of(PLATFORM_HEADING), of(FULL_PITCH, PLATFORM_PITCH), of(FULL_ROLL, PLATFORM_ROLL)),
            (of(AZIMUTH), of(ELEVATION), of(ROLL)),
        ),
        hfov_deg=of(FIELD),
        centre=None if None in centre else centre,  # type: ignore[arg-type]
        time_s=int.from_bytes(values[TIME], "big") * 1e-6 if len(values.get(TIME, b"")) == TIME_BYTES else None,
        leap_s=int.from_bytes(leaps, "big", signed=True) if 0 < len(leaps) <= TIME_BYTES else None,
    )


Angles = tuple[float | None, float | None, float | None]


def _angles(platform: Angles, sensor: Angles) -> tuple[float, float, float] | None:
    """Rz Ry Rx of the platform times Rz Ry Rx of the sensor. A missing roll is 0; of the others none may be missing."""
    if None in (*platform[:2], *sensor[:2]):
        return None
    outer, inner = (
        quaternion_from_euler(*(radians(value or 0.0) for value in reversed(each))) for each in (platform, sensor)
    )
    roll, pitch, yaw = euler_from_quaternion(multiply(outer, inner))
    return degrees(roll), degrees(pitch), degrees(yaw)
