"""Parrot's timed metadata (track `mett`) in the videos of Bebop, Disco and ANAFI. PURE.

A sample is a record with a two-letter name, its length in 32-bit words, and big-endian fields at fixed offsets; records
that extend it follow. Source: Parrot's pdraw documentation ("Video metadata"), versions 1 to 3. The view's quaternion
(w, x, y, z) turns the camera's axes (forward, right, down) to north, east, down.
"""

from __future__ import annotations

import struct
from math import degrees, hypot
from typing import Final

import msgspec

from fwav_companion.geometry.rotations import euler_from_quaternion
from fwav_companion.photographs.picture_pose import AltDatum
from fwav_companion.photographs.telemetry_rows import TelemetryRow, focal_of_field, is_place

QUATERNION_TOLERANCE: Final = 0.05
"""Largest difference of a quaternion's norm from 1; a record without a view has zeros."""


class RecordLayout(msgspec.Struct, frozen=True, kw_only=True):
    """Offsets and units of one version of the record."""

    size: int
    place: int
    """Latitude, longitude, altitude: 32-bit; of the altitude 24 bits are 1/256 m, the lowest 8 count satellites."""
    degree: float
    """Units in a degree of latitude and longitude."""
    view: int
    """Quaternion: four 16-bit numbers."""
    one: float
    """Units in 1 of the quaternion."""
    takeoff: int | None = None
    """Height above the take-off, 16.16."""
    field: int | None = None
    """Horizontal field of view, 8.8 degrees."""


RECORDS: Final = {
    b"P1": RecordLayout(size=56, place=28, degree=2.0**20, view=14, one=2.0**12, takeoff=40),
    b"P2": RecordLayout(size=56, place=8, degree=2.0**22, view=36, one=2.0**14),
    b"P3": RecordLayout(size=72, place=8, degree=2.0**22, view=44, one=2.0**14, field=60),
}


def parrot_row(sample: bytes, at_s: float) -> TelemetryRow | None:
    """What a sample says; None where it is no such record, or has no place."""
    layout = RECORDS.get(sample[:2])
    if layout is None or len(sample) < layout.size:
        return None
    lat, lon, altitude = struct.unpack_from(">iii", sample, layout.place)
    lat_deg, lon_deg = lat / layout.degree, lon / layout.degree
    if not is_place(lat_deg, lon_deg):
        return None
    w, x, y, z = (each / layout.one for each in struct.unpack_from(">hhhh", sample, layout.view))
    angles = None
    norm = hypot(w, x, y, z)
    if abs(norm - 1.0) <= QUATERNION_TOLERANCE:
        roll, pitch, yaw = euler_from_quaternion((w / norm, x / norm, y / norm, z / norm))
        angles = (degrees(roll), degrees(pitch), degrees(yaw))
    field = None if layout.field is None else struct.unpack_from(">H", sample, layout.field)[0] / 256.0
    takeoff = None if layout.takeoff is None else struct.unpack_from(">i", sample, layout.takeoff)[0] / 65536.0
    return TelemetryRow(
        at_s=at_s,
        until_s=at_s,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        above_takeoff_m=takeoff,
        absolute_m=(altitude >> 8) / 256.0,
        absolute_datum=AltDatum.EGM96,
        angles_deg=angles,
        focal_35mm=focal_of_field(field),
    )
