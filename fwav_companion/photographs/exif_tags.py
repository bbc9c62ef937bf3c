"""Values of EXIF 2.32 by their tag numbers: position, times, focal length, and the orientation of the image."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta, timezone
from typing import Any, Final

from fwav_companion.photographs.tags import PictureTags, finite_number

MAKE, MODEL, ORIENTATION = 0x010F, 0x0110, 0x0112
TIME, SUBSECONDS, OFFSET, EXPOSURE = 0x9003, 0x9291, 0x9011, 0x829A
"""DateTimeOriginal, SubSecTimeOriginal, OffsetTimeOriginal, ExposureTime."""
FOCAL_35MM, DIGITAL_ZOOM, FOCAL_MM, WIDTH, HEIGHT = 0xA405, 0xA404, 0x920A, 0xA002, 0xA003
GPS_TIME, GPS_DATE, LAT_REF, LAT, LON_REF, LON, ALT_REF, ALT = 7, 29, 1, 2, 3, 4, 5, 6
DIRECTION_REF, DIRECTION = 16, 17
"""GPSImgDirectionRef (T true, M magnetic) and GPSImgDirection."""
LARGEST_LAT_DEG: Final = 90.0


def text_of(tags: PictureTags, tag: int) -> str:
    """The text of a tag, without padding."""
    value = tags.exif.get(tag, "")
    return (value.decode("ascii", "replace") if isinstance(value, bytes) else str(value)).strip("\0 \t\r\n")


def exif_place(tags: PictureTags) -> tuple[float, float] | None:
    """Latitude and longitude, degrees."""
    lat, lon = _degrees(tags.gps.get(LAT)), _degrees(tags.gps.get(LON))
    if lat is None or lon is None:
        return None
    south, west = _letter(tags.gps.get(LAT_REF)) == "S", _letter(tags.gps.get(LON_REF)) == "W"
    return (-lat if south else lat, -lon if west else lon)


def exif_direction(tags: PictureTags) -> float | None:
    """Direction of the image, degrees clockwise from true north; None without one, or from magnetic north."""
    direction = finite_number(tags.gps.get(DIRECTION))
    is_true = _letter(tags.gps.get(DIRECTION_REF)) != "M"
    return direction if direction is not None and is_true and 0.0 <= direction <= 360.0 else None


def exif_altitude(tags: PictureTags) -> float | None:
    """Altitude, metres; GPSAltitudeRef 1 means below the reference."""
    altitude = finite_number(tags.gps.get(ALT))
    below = tags.gps.get(ALT_REF) in (1, b"\x01", "1")
    return -altitude if altitude is not None and below else altitude


def stated_size(tags: PictureTags) -> tuple[int, int] | None:
    """Width and height of the image when it was taken, by EXIF."""
    width, height = finite_number(tags.exif.get(WIDTH)), finite_number(tags.exif.get(HEIGHT))
    return (int(width), int(height)) if width and height and width >= 1.0 and height >= 1.0 else None


def orientation(tags: PictureTags) -> int:
    """How a viewer turns the stored image, 1 to 8; 1: it does not."""
    value = tags.exif.get(ORIENTATION)
    return value if isinstance(value, int) and 1 <= value <= 8 else 1


def local_time(tags: PictureTags) -> datetime | None:
    """Time of the camera's clock, without a zone."""
    try:
        seconds = datetime.strptime(text_of(tags, TIME), "%Y:%m:%d %H:%M:%S")  # noqa: DTZ007  # the zone has its own tag
    except ValueError:
        return None
    digits = re.match(r"[0-9]{1,6}", text_of(tags, SUBSECONDS))
    return seconds + timedelta(microseconds=int(digits[0].ljust(6, "0"))) if digits else seconds


def utc_time(tags: PictureTags) -> float | None:
    """Unix time: UTCAtExposure, else the camera's clock with its zone, else GPS time, often in whole seconds."""
    exact = _exact_utc(tags.text("UTCAtExposure"))
    if exact is not None:
        return exact
    local = local_time(tags)
    offset = re.fullmatch(r"([+-])([0-9]{2}):([0-9]{2})", text_of(tags, OFFSET))
    if local is not None and offset:
        minutes = int(offset[2]) * 60 + int(offset[3])
        zone = timezone(timedelta(minutes=-minutes if offset[1] == "-" else minutes)) if minutes < 1440 else UTC
        return local.replace(tzinfo=zone).timestamp()
    parts = tags.gps.get(GPS_TIME, ())
    try:
        day = datetime.strptime(str(tags.gps.get(GPS_DATE)).strip("\0"), "%Y:%m:%d").replace(tzinfo=UTC)
        hours, minutes_, seconds = (part for each in parts if (part := finite_number(each)) is not None)
    except (ValueError, TypeError):
        return None
    return day.timestamp() + 3600.0 * hours + 60.0 * minutes_ + seconds


def _exact_utc(text: str) -> float | None:
    """UTCAtExposure: microseconds since 1970, or a date with its time."""
    microseconds = finite_number(text)
    if microseconds is not None:
        return microseconds * 1e-6 if microseconds > 0.0 else None
    try:
        return datetime.fromisoformat(text.replace(":", "-", 2)).replace(tzinfo=UTC).timestamp()
    except ValueError:
        return None


def _letter(value: Any) -> str:
    text = value.decode("ascii", "replace") if isinstance(value, bytes) else str(value or "")
    return text.strip("\0 ").upper()[:1]


def _degrees(parts: Any) -> float | None:
    numbers = [finite_number(part) for part in parts] if isinstance(parts, tuple) and len(parts) == 3 else []
    known = [number for number in numbers if number is not None]
    return known[0] + known[1] / 60.0 + known[2] / 3600.0 if len(known) == 3 else None
