"""Lines of a targets file that somebody hands in: what is whole is used, what is not is counted. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

import msgspec

from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.recording.lines import Line
from fwav_companion.types import ErrorBudget

Metres = Annotated[float, msgspec.Meta(ge=-1e8, le=1e8)]
"""From an origin: more than the Earth is wide."""


class Place(msgspec.Struct):
    """Of an origin, degrees and metres."""

    lat: float
    lon: float
    alt_amsl: float


class Header(msgspec.Struct, tag="header"):
    """The first line."""

    version: str
    unix_offset_s: float
    config: dict[str, object]
    origin: Place | None


class Origin(msgspec.Struct, tag="origin"):
    """Where it came later."""

    origin: Place | None


class GroundPoint(msgspec.Struct):
    """A fix."""

    north: Metres
    east: Metres


class Expected(msgspec.Struct):
    """A fix against where its target was believed before."""

    north: Metres
    east: Metres
    distance2: Annotated[float, msgspec.Meta(ge=0.0)]


class Target(msgspec.Struct, tag="target"):
    """A track at a frame."""

    time_unix: float
    frame: int | None
    track: int
    label: str
    state: str
    north: Metres
    east: Metres
    cov: Matrix3
    fix: GroundPoint | None
    innovation: Expected | None = None
    lat: float | None = None
    lon: float | None = None


class SightingLine(msgspec.Struct, tag="sighting"):
    """A detection."""

    frame: int | None
    reason: str | None
    gap_s: float | None
    time_boot: float | None
    camera_ned: Vector3 | None
    budget: ErrorBudget | None


class ClockLine(msgspec.Struct, tag="clock"):
    """Once a second."""

    time_monotonic: float
    host_from_autopilot_s: float
    sigma_s: float
    bound_s: float
    round_trip_s: float | None = None
    status: str = ""


class CalibrationLine(msgspec.Struct, tag="calibration"):
    """Once a second while it calibrates itself."""

    time_unix: float
    time_offset_s: float
    time_offset_sigma_s: float
    mount_deg: Vector3
    mount_sigma_deg: Vector3
    status: str
    mistake: str = ""


class Summary(msgspec.Struct, tag="summary"):
    """The last line."""

    frames: int
    detections: int
    fixes: int
    dropped: dict[str, int]


Form = Header | Origin | Target | SightingLine | ClockLine | CalibrationLine | Summary
FORMS = ("header", "origin", "target", "sighting", "clock", "calibration", "summary")


def read_lines(content: Iterable[bytes]) -> tuple[list[Line], int]:
    """The lines that are whole, and how many were not: a power cut leaves the last one in pieces.

    Lines of kinds that a report does not know are left as they are.
    """
    lines: list[Line] = []
    damaged = 0
    for told in content:
        if not told.strip():
            continue
        try:
            line = msgspec.json.decode(told, type=dict[str, object])
            if line.get("type") in FORMS:
                msgspec.convert(line, Form)
            lines.append(line)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            damaged += 1
    return lines, damaged
