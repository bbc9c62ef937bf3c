"""Telemetry of a video in the CSV that Airdata makes of a flight's log. PURE.

Units are in the header: (feet) or (meters). Times count from the flight's start, those of the result from the video's:
the rising edge of isVideo.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from typing import Final

from fwav_companion.errors import InputFileError
from fwav_companion.photographs.srt import SubtitleRow
from fwav_companion.photographs.tags import finite_number

TIME, VIDEO, LAT, LON = "time(millisecond)", "isVideo", "latitude", "longitude"
HEIGHT, ABSOLUTE = "height_above_takeoff", "altitude_above_seaLevel"
ANGLES: Final = ("gimbal_roll(degrees)", "gimbal_pitch(degrees)", "gimbal_heading(degrees)")
UNITS: Final = {"(feet)": 0.3048, "(meters)": 1.0}
ACCEPTED: Final = f"a CSV of Airdata with {TIME}, {LAT}, {LON} and {VIDEO}"


def parse_airdata(text: str, name: str) -> list[SubtitleRow]:
    """The rows while the video runs, by its own time. InputFileError where there is none, or more than one video."""
    reader = csv.DictReader(text.removeprefix("\ufeff").splitlines(keepends=True), skipinitialspace=True)
    try:
        columns = [column.strip() for column in reader.fieldnames or ()]
        reader.fieldnames = columns
        if not {TIME, VIDEO, LAT, LON} <= set(columns):
            raise InputFileError(f"{name}: not Airdata's columns; accepted: {ACCEPTED}")
        videos = _videos(list(reader), columns)
    except csv.Error as error:
        raise InputFileError(f"{name}: line {reader.line_num}: {error}; accepted: {ACCEPTED}") from None
    if len(videos) != 1:
        raise InputFileError(f"{name}: {len(videos)} videos in it; accepted: the lines of one, with {VIDEO} 0 before")
    return videos[0]


def _videos(lines: list[dict[str, str]], columns: list[str]) -> list[list[SubtitleRow]]:
    """The rows of each video, by times from its beginning."""
    videos: list[list[SubtitleRow]] = []
    begun_s: float | None = None
    for line in lines:
        at_ms = finite_number(line.get(TIME))
        if at_ms is None:
            continue
        if finite_number(line.get(VIDEO)) != 1.0:
            begun_s = None
            continue
        if begun_s is None:
            begun_s = at_ms * 1e-3
            videos.append([])
        row = _row(line, columns, at_ms * 1e-3 - begun_s)
        if row is not None:
            videos[-1].append(row)
    return [video for video in videos if video]


def _row(line: Mapping[str, str], columns: list[str], at_s: float) -> SubtitleRow | None:
    lat, lon = finite_number(line.get(LAT)), finite_number(line.get(LON))
    if lat is None or lon is None or (lat, lon) == (0.0, 0.0) or abs(lat) > 90.0 or abs(lon) > 180.0:
        return None
    angles = [finite_number(line.get(column)) for column in ANGLES]
    roll, pitch, yaw = angles
    return SubtitleRow(
        at_s=at_s,
        until_s=at_s,
        lat_deg=lat,
        lon_deg=lon,
        above_takeoff_m=_metres(line, columns, HEIGHT),
        absolute_m=_metres(line, columns, ABSOLUTE),
        angles_deg=None if roll is None or pitch is None or yaw is None else (roll, pitch, yaw),
    )


def _metres(line: Mapping[str, str], columns: list[str], name: str) -> float | None:
    column = next((each for each in columns if each.startswith(name)), "")
    value, unit = finite_number(line.get(column)), UNITS.get(column.removeprefix(name))
    return None if value is None or unit is None else value * unit
