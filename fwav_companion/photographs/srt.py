"""Telemetry in the subtitles (.SRT) of DJI's videos, in the layouts from 2017 to today. PURE.

Known layouts: GPS(lon,lat,n) BAROMETER:x of the Mavic Pro, once a second; GPS(lat,lon,0.0M) of the M300; one line with
F/, SS, GPS (lon, lat, n), D, H of the Phantom 4, Mini and Mavic 2, some with G.PRY (pitch, roll, yaw); brackets with
latitude, longitude (also "longtitude"), altitude or rel_alt and abs_alt, newer ones with gb_yaw, gb_pitch, gb_roll.
Cue times are the video's. Read by key, as firmwares differ in spaces and in the decimal sign.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Final

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.photographs.picture_pose import AltDatum

CUE: Final = re.compile(r"(\d{1,3}):(\d{2}):(\d{2})[,.](\d{1,3})\s*-->\s*(\d{1,3}):(\d{2}):(\d{2})[,.](\d{1,3})")
NUMBER: Final = r"[-+]?\d+(?:\.\d+)?"
PAIR: Final = re.compile(rf"([A-Za-z_]+)\s*:\s*({NUMBER})")
GPS: Final = re.compile(rf"GPS\s*\(\s*({NUMBER})\s*,\s*({NUMBER})\s*(?:,\s*({NUMBER})\s*(M?))?\s*\)")
HEIGHT: Final = re.compile(rf"\bH\s+({NUMBER})\s*m\b")
BAROMETER: Final = re.compile(rf"\b(?:BAROMETER|Hb)\s*:\s*({NUMBER})")
GIMBAL: Final = re.compile(rf"G\.PRY\s*\(\s*({NUMBER})\D+?({NUMBER})\D+?({NUMBER})\D*?\)")
MOST_ROWS: Final = 2_000_000
"""Rows of nine hours of video at 60 frames/s."""
TENTHS_FROM: Final = 100.0
"""focal_len above this is in tenths of a millimetre: 240 is 24.0 mm."""


class SubtitleRow(msgspec.Struct, frozen=True, kw_only=True):
    """What one subtitle says; None for what it does not."""

    at_s: float
    """Start of the cue, in seconds of the video."""
    until_s: float
    lat_deg: float | None = None
    lon_deg: float | None = None
    above_takeoff_m: float | None = None
    absolute_m: float | None = None
    absolute_datum: AltDatum | None = None
    """Datum of the absolute altitude; None: the layout does not state it."""
    angles_deg: tuple[float, float, float] | None = None
    """Roll, pitch and yaw of the gimbal; pitch 0 is the horizon."""
    focal_35mm: float | None = None
    """35 mm equivalent focal length, millimetres, zoom included."""


def parse_srt(text: str, name: str) -> list[SubtitleRow]:
    """The rows that have a place. InputFileError where none has."""
    text = text.removeprefix("\ufeff").replace("\r", "")
    rows = [row for row in _rows(text) if row.lat_deg is not None]
    if not rows:
        raise InputFileError(f"{name}: no subtitle in it has a position; accepted: the .SRT of a DJI drone")
    return sorted(rows[:MOST_ROWS], key=lambda row: row.at_s)


def _rows(text: str) -> Iterator[SubtitleRow]:
    cues = list(CUE.finditer(text))
    for cue, following in zip(cues, [*cues[1:], None], strict=False):
        body = text[cue.end() : len(text) if following is None else following.start()]
        yield _row(_seconds(cue.groups()[:4]), _seconds(cue.groups()[4:]), body)


def _seconds(parts: tuple[str, ...]) -> float:
    hours, minutes, seconds, fraction = parts
    return int(hours) * 3600.0 + int(minutes) * 60.0 + int(seconds) + int(fraction.ljust(3, "0")) * 1e-3


def _row(at_s: float, until_s: float, body: str) -> SubtitleRow:
    pairs = {key.lower(): float(value) for key, value in PAIR.findall(body)}
    place = _place(pairs, body)
    height, barometer = HEIGHT.search(body), BAROMETER.search(body)
    above = pairs.get("rel_alt")
    if above is None and (height or barometer):
        above = float((height or barometer)[1])  # type: ignore[index]
    return SubtitleRow(
        at_s=at_s,
        until_s=until_s,
        lat_deg=None if place is None else place[0],
        lon_deg=None if place is None else place[1],
        above_takeoff_m=above,
        absolute_m=pairs.get("abs_alt", pairs.get("altitude")),
        angles_deg=_angles(pairs, body),
        focal_35mm=_focal(pairs),
    )


def _place(pairs: Mapping[str, float], body: str) -> tuple[float, float] | None:
    """Latitude and longitude; 0, 0 is no place. In GPS(...) longitude comes first, but where the third is metres."""
    lat, lon = pairs.get("latitude"), pairs.get("longitude", pairs.get("longtitude"))
    if lat is None or lon is None:
        found = GPS.search(body)
        if found is None:
            return None
        first, second = float(found[1]), float(found[2])
        lat, lon = (first, second) if found[4] else (second, first)
    if (lat, lon) == (0.0, 0.0) or abs(lat) > 90.0 or abs(lon) > 180.0:
        return None
    return lat, lon


def _angles(pairs: Mapping[str, float], body: str) -> tuple[float, float, float] | None:
    if all(key in pairs for key in ("gb_yaw", "gb_pitch", "gb_roll")):
        return (pairs["gb_roll"], pairs["gb_pitch"], pairs["gb_yaw"])
    found = GIMBAL.search(body)
    return None if found is None else (float(found[2]), float(found[1]), float(found[3]))


def _focal(pairs: Mapping[str, float]) -> float | None:
    focal = pairs.get("focal_len")
    if focal is None or focal <= 0.0:
        return None
    zoom = pairs.get("dzoom_ratio", 1.0)
    zoom = zoom / 10000.0 if zoom >= 1000.0 else zoom  # newer firmware: 10000 is 1x
    return (focal / 10.0 if focal > TENTHS_FROM else focal) * max(1.0, zoom)
