"""True target positions from a CSV or JSONL file. PURE."""

from __future__ import annotations

import csv
import io
import json
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from math import isfinite
from typing import Any

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.vectors import Vector3

ACCEPTED = "label and (lat, lon, alt_amsl) or (north, east, down), optionally time_unix"


class TruthPoint(msgspec.Struct, frozen=True):
    """True position of one target at one time."""

    label: str
    place: Geodetic | None
    ned: Vector3 | None
    """Position in NED, metres; None if the file has no NED positions."""
    time_unix: float | None
    """Time, Unix seconds; None: the target is stationary."""


def parse_truth(text: str, name: str) -> list[TruthPoint]:
    """Points of a truth file. InputFileError names the line and what is accepted."""
    text = text.removeprefix("\ufeff")  # a spreadsheet's byte order mark would become part of the first column's name
    rows = _json_rows(text, name) if text.lstrip().startswith("{") else _csv_rows(text, name)
    points = [_point(row, f"{name}: line {number}") for number, row in rows]
    if not points:
        raise InputFileError(f"{name}: it has no point; accepted: CSV or JSONL with {ACCEPTED}")
    return points


def _json_rows(text: str, name: str) -> Iterable[tuple[int, Mapping[str, Any]]]:
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        try:
            row = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise InputFileError(f"{name}: line {number}: not JSON ({error}); accepted: {ACCEPTED}") from error
        if isinstance(row, dict):
            yield number, row


def _csv_rows(text: str, name: str) -> Iterable[tuple[int, Mapping[str, Any]]]:
    reader = csv.DictReader(io.StringIO(text, newline=""), skipinitialspace=True)
    try:
        for row in reader:
            yield reader.line_num, row
    except csv.Error as error:
        raise InputFileError(f"{name}: line {reader.line_num}: {error}; accepted: {ACCEPTED}") from error


def _point(row: Mapping[str, Any], where: str) -> TruthPoint:
    geodetic, ned = _numbers(row, ("lat", "lon", "alt_amsl"), where), _numbers(row, ("north", "east", "down"), where)
    if geodetic is None and ned is None:
        raise InputFileError(f"{where}: {dict(row)!r} has no position; accepted: {ACCEPTED}")
    time = _numbers(row, ("time_unix",), where)
    if geodetic is not None and not (abs(geodetic[0]) <= 90.0 and abs(geodetic[1]) <= 180.0):
        raise InputFileError(f"{where}: lat {geodetic[0]:g}, lon {geodetic[1]:g} is out of range; accepted: degrees")
    return TruthPoint(
        label=str(row.get("label") or ""),
        place=Geodetic.from_degrees(*geodetic) if geodetic else None,
        ned=(ned[0], ned[1], ned[2]) if ned else None,
        time_unix=time[0] if time else None,
    )


def _numbers(row: Mapping[str, Any], names: tuple[str, ...], where: str) -> list[float] | None:
    """The named numbers; None if one is missing or empty."""
    if any(row.get(name) in (None, "") for name in names):
        return None
    try:
        values = [float(row[name]) for name in names]
    except (TypeError, ValueError, OverflowError) as error:
        raise InputFileError(f"{where}: {error}; accepted: {ACCEPTED}") from error
    if not all(map(isfinite, values)):
        raise InputFileError(f"{where}: {dict(row)!r} is not finite; accepted: {ACCEPTED}")
    return values


class Truth:
    """True positions of one label over time."""

    def __init__(self, points: Iterable[TruthPoint]) -> None:
        self._points = sorted(points, key=lambda point: point.time_unix or 0.0)
        self._times = [point.time_unix or 0.0 for point in self._points]

    def ned_at(self, time_unix: float, plane: TangentPlane | None) -> Vector3 | None:
        """Position at a time, linear between points and constant outside; None if it cannot be expressed in NED."""
        after = bisect_right(self._times, time_unix)
        if after in (0, len(self._points)):
            return _ned(self._points[min(after, len(self._points) - 1)], plane)
        first, second = _ned(self._points[after - 1], plane), _ned(self._points[after], plane)
        span = self._times[after] - self._times[after - 1]
        if first is None or second is None or span <= 0.0:
            return first
        share = (time_unix - self._times[after - 1]) / span
        return (
            first[0] + share * (second[0] - first[0]),
            first[1] + share * (second[1] - first[1]),
            first[2] + share * (second[2] - first[2]),
        )


def _ned(point: TruthPoint, plane: TangentPlane | None) -> Vector3 | None:
    if point.place is not None and plane is not None:
        return plane.ned_from_geodetic(point.place)
    return point.ned
