"""OpenDroneMap's gcp_list.txt: surveyed points, and their pixels in pictures. PURE.

A line of the coordinate system, then a line a sight: X Y Z px py image [label]. px and py count from the picture's
corner.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Final

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.photographs.table_crs import ACCEPTED as ACCEPTED_CRS
from fwav_companion.photographs.table_crs import table_crs

LINE: Final = "X Y Z px py image [label]"
LEAST_PARTS: Final = 6


class ControlSight(msgspec.Struct, frozen=True):
    """One line: a point in one picture, as it is written."""

    place: tuple[str, ...]
    pixel: tuple[str, str]
    file: str
    label: str
    """Lines without label share one where their coordinates are the same: it is one point."""
    where: str
    """File and line, for errors."""


def is_ground_control(text: str) -> bool:
    """Whether a file's first line is a coordinate system."""
    first = next(_content(text), None)
    return first is not None and table_crs(first[1]) is not None


def control_sights(text: str, name: str, accepted: str = LINE) -> Iterator[ControlSight]:
    """The sights in their order, whatever the coordinate system. InputFileError names the line."""
    labels: dict[tuple[str, ...], str] = {}
    for index, (number, line) in enumerate(_content(text)):
        if index == 0:
            continue
        parts = re.split(r"\s+", line)
        where = f"{name}: line {number}"
        if len(parts) < LEAST_PARTS:
            raise InputFileError(f"{where}: {line[:60]!r}; accepted: {accepted}")
        place = tuple(parts[:3])
        label = parts[6] if len(parts) > LEAST_PARTS else labels.setdefault(place, f"point {len(labels) + 1}")
        yield ControlSight(place, (parts[3], parts[4]), parts[5], label, where)


def control_points(text: str, name: str) -> Mapping[str, tuple[float, float, float]]:
    """Latitude, longitude and altitude of each label. InputFileError names the line and what is accepted."""
    first = next(_content(text), (1, ""))
    crs = table_crs(first[1])
    if crs is None:
        raise InputFileError(f"{name}: line {first[0]}: {first[1][:60]!r}; accepted: {ACCEPTED_CRS}")
    points: dict[str, tuple[float, float, float]] = {}
    for sight in control_sights(text, name):
        try:
            x, y, altitude = (float(each) for each in sight.place)
            lat, lon = crs.degrees(x, y)
        except (ValueError, OverflowError):
            lat = lon = altitude = float("nan")
        if not all(map(isfinite, (lat, lon, altitude))):
            raise InputFileError(f"{sight.where}: {' '.join(sight.place)} is no place; accepted: {LINE}")
        points.setdefault(sight.label, (lat, lon, altitude))
    return points


def _content(text: str) -> Iterator[tuple[int, str]]:
    """The lines with their numbers, but for empty ones and comments."""
    for number, line in enumerate(text.removeprefix("\ufeff").splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line.strip()
