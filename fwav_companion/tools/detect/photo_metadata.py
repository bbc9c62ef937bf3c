"""Time and pose of a photograph by its metadata: EXIF by Pillow, and XMP of the common makers of drones.

A maker's gimbal angles count from the horizon and true or magnetic north, for a camera that looks ahead at zero: the
rule of [camera.mount]. Which of the two norths a maker means is not in the file.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta, timezone
from fractions import Fraction
from math import isfinite
from pathlib import Path
from typing import Any

import msgspec

from fwav_companion.errors import InputFileError

EXIF_IFD, GPS_IFD = 0x8769, 0x8825
TIME, SUBSECONDS, OFFSET, EXPOSURE = 0x9003, 0x9291, 0x9011, 0x829A
"""DateTimeOriginal, SubSecTimeOriginal, OffsetTimeOriginal, ExposureTime (EXIF 2.32)."""
GPS_TIME, GPS_DATE, LAT_REF, LAT, LON_REF, LON, ALT_REF, ALT = 7, 29, 1, 2, 3, 4, 5, 6
XMP_END = b"</x:xmpmeta>"
MOST_XMP = 1 << 20
"""Bytes at the start of a file that are searched for its XMP, which precedes the picture."""
ANGLES = {
    "DJI": ("GimbalRollDegree", "GimbalPitchDegree", "GimbalYawDegree"),
    "Parrot": ("CameraRollDegree", "CameraPitchDegree", "CameraYawDegree"),
    "Autel": ("Camera:Roll", "Camera:Pitch", "Camera:Yaw"),
}
"""Names of roll, pitch and yaw of the camera, degrees. DJI: also Hasselblad; Autel: also senseFly."""
PLACE = ("GpsLatitude", "GpsLongitude", "AbsoluteAltitude")
LONGITUDE_BY_OLD_DJI = "GpsLongtitude"
RTK = ("RtkStdLat", "RtkStdLon", "RtkStdHgt")
"""One sigma by DJI's RTK receivers, metres."""


class PhotoMetadata(msgspec.Struct, frozen=True, kw_only=True):
    """Metadata of a photograph; None for a value that it does not have."""

    utc_s: float | None = None
    """Unix time of the exposure."""
    local: datetime | None = None
    """Time of the camera's clock, without a zone."""
    exposure_s: float | None = None
    pose: Mapping[str, float] | None = None
    """Columns of a file of poses."""


def read_metadata(path: Path) -> PhotoMetadata:
    """The metadata of a photograph. InputFileError where the file cannot be read."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            exif = image.getexif()
            own, gps = dict(exif.get_ifd(EXIF_IFD)), dict(exif.get_ifd(GPS_IFD))
        with path.open("rb") as file:
            head = file.read(MOST_XMP)
    except (OSError, UnidentifiedImageError, SyntaxError, ValueError):
        raise InputFileError(f"{path}: not a picture; accepted: JPEG, PNG or TIFF") from None
    local = _local(own)
    return PhotoMetadata(
        utc_s=_utc(own, gps, local),
        local=local,
        exposure_s=_number(own.get(EXPOSURE)),
        pose=_pose(xmp_of(head), gps),
    )


def _local(own: Mapping[int, Any]) -> datetime | None:
    try:
        seconds = datetime.strptime(str(own.get(TIME)), "%Y:%m:%d %H:%M:%S")  # noqa: DTZ007  # the zone has its own tag
    except ValueError:
        return None
    digits = re.match(r"[0-9]{1,6}", str(own.get(SUBSECONDS, "")).strip())
    return seconds + timedelta(microseconds=int(digits[0].ljust(6, "0"))) if digits else seconds


def _utc(own: Mapping[int, Any], gps: Mapping[int, Any], local: datetime | None) -> float | None:
    """Unix time by the offset of the camera's clock, else by GPS, whose time many makers round to whole seconds."""
    offset = re.fullmatch(r"([+-])([0-9]{2}):([0-9]{2})", str(own.get(OFFSET, "")).strip().strip("\0"))
    if local is not None and offset:
        minutes = int(offset[2]) * 60 + int(offset[3])
        zone = timezone(timedelta(minutes=-minutes if offset[1] == "-" else minutes))
        return local.replace(tzinfo=zone).timestamp()
    parts = [_number(part) for part in gps.get(GPS_TIME, ())]
    try:
        day = datetime.strptime(str(gps.get(GPS_DATE)).strip("\0"), "%Y:%m:%d").replace(tzinfo=UTC)
        hours, minutes_, seconds = (part for part in parts if part is not None)
    except ValueError:
        return None
    return day.timestamp() + 3600.0 * hours + 60.0 * minutes_ + seconds


def xmp_of(head: bytes) -> dict[str, str]:
    """The values of an XMP packet by their names, with and without the prefix: attributes, and elements with text.

    Read by pattern and not as XML: some makers' packets are not well-formed.
    """
    begin = head.find(b"<x:xmpmeta")
    text = head[begin : head.find(XMP_END, begin)].decode("utf-8", "replace") if begin >= 0 else ""
    found: dict[str, str] = {}
    for pattern in (r'([\w-]+):([\w-]+)\s*=\s*"([^"]*)"', r"<([\w-]+):([\w-]+)>([^<]*)</"):
        for prefix, name, value in re.findall(pattern, text):
            found.setdefault(name, value.strip())
            found.setdefault(f"{prefix}:{name}", value.strip())
    return found


def _pose(xmp: Mapping[str, str], gps: Mapping[int, Any]) -> dict[str, float] | None:
    """The columns of a pose; None unless place and angles are there."""
    angles = _angles(xmp)
    place = [_number(xmp.get(name)) for name in PLACE]
    place[1] = _number(xmp.get(LONGITUDE_BY_OLD_DJI)) if place[1] is None else place[1]
    if None in place:
        place = list(_exif_place(gps))
    if angles is None or None in place:
        return None
    columns = zip(("lat", "lon", "alt_amsl", "roll_deg", "pitch_deg", "yaw_deg"), (*place, *angles), strict=True)
    pose = {name: float(value) for name, value in columns if value is not None}
    lat, lon, height = (_number(xmp.get(name)) for name in RTK)
    if lat and lon and height:
        pose |= {"position_sigma_m": max(lat, lon), "height_sigma_m": height}
    return pose


def _angles(xmp: Mapping[str, str]) -> list[float] | None:
    """Roll, pitch and yaw by the first maker whose names are all there."""
    for names in ANGLES.values():
        numbers = [number for name in names if (number := _number(xmp.get(name))) is not None]
        if len(numbers) == len(names):
            return numbers
    return None


def _exif_place(gps: Mapping[int, Any]) -> tuple[float | None, float | None, float | None]:
    lat, lon, alt = _degrees(gps.get(LAT)), _degrees(gps.get(LON)), _number(gps.get(ALT))
    below = gps.get(ALT_REF) in (1, b"\x01")
    return (
        -lat if lat is not None and gps.get(LAT_REF) == "S" else lat,
        -lon if lon is not None and gps.get(LON_REF) == "W" else lon,
        -alt if alt is not None and below else alt,
    )


def _degrees(parts: Any) -> float | None:
    numbers = [_number(part) for part in parts] if isinstance(parts, tuple) and len(parts) == 3 else []
    known = [number for number in numbers if number is not None]
    return known[0] + known[1] / 60.0 + known[2] / 3600.0 if len(known) == 3 else None


def _number(value: Any) -> float | None:
    """The value as a finite number; None where it is not one."""
    try:
        number = float(Fraction(value)) if isinstance(value, str) and "/" in value else float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if isfinite(number) else None
