"""Telemetry of a video in the CSV that a flight's log is exported to: Airdata's, and Litchi's. PURE.

Units are in the header: (feet) or (meters), (m). Times count from the flight's start, those of the result from the
video's: the rising edge of isVideo or isTakingVideo. Litchi's Raw angles are in tenths of a degree.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Final

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.photographs.tags import finite_number
from fwav_companion.photographs.telemetry_rows import TelemetryRow, is_place

MILLISECONDS, UTC_TIME, LAT, LON = "time(millisecond)", "datetime(utc)", "latitude", "longitude"
UNITS: Final = {"(feet)": 0.3048, "(meters)": 1.0, "(m)": 1.0}
MOST_ROWS: Final = 2_000_000


class CsvLayout(msgspec.Struct, frozen=True, kw_only=True):
    """The columns of one program's export."""

    program: str
    video: str
    height: str
    """Beginning of the column of the height above the take-off; its unit follows."""
    absolute: str
    """The same of the absolute altitude; "" where there is none."""
    angles: tuple[str, str, str]
    """Roll, pitch and yaw of the gimbal."""
    degrees: float
    """Degrees in a unit of the angles."""


LAYOUTS: Final = (
    CsvLayout(
        program="Airdata",
        video="isVideo",
        height="height_above_takeoff",
        absolute="altitude_above_seaLevel",
        angles=("gimbal_roll(degrees)", "gimbal_pitch(degrees)", "gimbal_heading(degrees)"),
        degrees=1.0,
    ),
    CsvLayout(
        program="Litchi",
        video="isTakingVideo",
        height="altitude",  # DJI's SDK gives the height above the take-off under this name
        absolute="",
        angles=("gimbalRollRaw", "gimbalPitchRaw", "gimbalYawRaw"),
        degrees=0.1,
    ),
)
ACCEPTED: Final = (
    f"a CSV of Airdata or Litchi with {MILLISECONDS} or {UTC_TIME}, {LAT}, {LON} and isVideo or isTakingVideo"
)


def parse_flight_csv(text: str, name: str) -> list[TelemetryRow]:
    """The rows while the video runs, by its own time. InputFileError where there is none, or more than one video."""
    reader = csv.DictReader(text.removeprefix("\ufeff").splitlines(keepends=True), skipinitialspace=True)
    try:
        columns = [column.strip() for column in reader.fieldnames or ()]
        reader.fieldnames = columns
        layout = next((each for each in LAYOUTS if each.video in columns), None)
        if layout is None or not {LAT, LON} <= set(columns) or not {MILLISECONDS, UTC_TIME} & set(columns):
            raise InputFileError(f"{name}: not the columns of Airdata or Litchi; accepted: {ACCEPTED}")
        videos = _videos(list(reader), columns, layout)
    except csv.Error as error:
        raise InputFileError(f"{name}: line {reader.line_num}: {error}; accepted: {ACCEPTED}") from None
    if len(videos) != 1:
        raise InputFileError(
            f"{name}: {len(videos)} videos in it; accepted: the lines of one, with {layout.video} 0 before"
        )
    return videos[0]


def _videos(lines: Sequence[dict[str, str]], columns: Sequence[str], layout: CsvLayout) -> list[list[TelemetryRow]]:
    """The rows of each video, by times from its beginning."""
    videos: list[list[TelemetryRow]] = []
    begun_s: float | None = None
    for line in lines[:MOST_ROWS]:
        at_s = _time_s(line)
        if at_s is None:
            continue
        if (line.get(layout.video) or "").strip().lower() not in ("1", "1.0", "true", "yes"):
            begun_s = None
            continue
        if begun_s is None:
            begun_s = at_s
            videos.append([])
        row = _row(line, columns, layout, at_s - begun_s)
        if row is not None and row.at_s >= 0.0:
            videos[-1].append(row)
    return [sorted(video, key=lambda row: row.at_s) for video in videos if video]


def _time_s(line: Mapping[str, str]) -> float | None:
    """Milliseconds of the flight, else the time of day: UTC's column has whole seconds in some exports."""
    at_ms = finite_number(line.get(MILLISECONDS))
    if at_ms is not None:
        return at_ms * 1e-3
    try:
        return datetime.fromisoformat((line.get(UTC_TIME) or "").strip()).replace(tzinfo=UTC).timestamp()
    except (ValueError, OverflowError):
        return None


def _row(line: Mapping[str, str], columns: Sequence[str], layout: CsvLayout, at_s: float) -> TelemetryRow | None:
    lat, lon = finite_number(line.get(LAT)), finite_number(line.get(LON))
    if not is_place(lat, lon):
        return None
    angles = [finite_number(line.get(column)) for column in layout.angles]
    roll, pitch, yaw = (None if angle is None else angle * layout.degrees for angle in angles)
    return TelemetryRow(
        at_s=at_s,
        until_s=at_s,
        lat_deg=lat,
        lon_deg=lon,
        above_takeoff_m=_metres(line, columns, layout.height),
        absolute_m=_metres(line, columns, layout.absolute) if layout.absolute else None,
        angles_deg=None if roll is None or pitch is None or yaw is None else (roll, pitch, yaw),
    )


def _metres(line: Mapping[str, str], columns: Sequence[str], name: str) -> float | None:
    column = next((each for each in columns if each.startswith(f"{name}(")), "")
    value, unit = finite_number(line.get(column)), UNITS.get(column.removeprefix(name))
    return None if value is None or unit is None else value * unit
