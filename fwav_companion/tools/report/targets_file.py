"""Reading a targets file from a user: lines that are whole are used, damaged lines are counted. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

import msgspec

from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.recording.lines import Line
from fwav_companion.types import ErrorBudget

PlausibleMetres = Annotated[float, msgspec.Meta(ge=-1e8, le=1e8)]
"""A distance from an origin, metres; the limit is several times the Earth's diameter."""


class OriginObject(msgspec.Struct):
    """An origin: degrees and metres."""

    lat: float
    lon: float
    alt_amsl: float | None
    """None where altitudes count from the take-off."""


class HeaderLine(msgspec.Struct, tag="header"):
    """The first line."""

    version: str
    unix_offset_s: float
    config: dict[str, object]
    origin: OriginObject | None


class OriginLine(msgspec.Struct, tag="origin"):
    """An origin that was known after the header was written."""

    origin: OriginObject | None


class FixObject(msgspec.Struct):
    """The fix of a target line."""

    north: PlausibleMetres
    east: PlausibleMetres


class InnovationObject(msgspec.Struct):
    """The innovation of a target line."""

    north: PlausibleMetres
    east: PlausibleMetres
    distance2: Annotated[float, msgspec.Meta(ge=0.0)]


class TargetLine(msgspec.Struct, tag="target"):
    """A track at a frame."""

    time_unix: float
    frame: int | None
    track: int
    label: str
    state: str
    north: PlausibleMetres
    east: PlausibleMetres
    cov: Matrix3
    fix: FixObject | None
    innovation: InnovationObject | None = None
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


class ClockEstimateLine(msgspec.Struct, tag="clock"):
    """The clock estimate, once a second."""

    time_monotonic: float
    host_from_autopilot_s: float
    sigma_s: float
    bound_s: float
    round_trip_s: float | None = None
    status: str = ""


class CalibrationLine(msgspec.Struct, tag="calibration"):
    """The state of self-calibration, once a second."""

    time_unix: float
    time_offset_s: float
    time_offset_sigma_s: float
    mount_deg: Vector3
    mount_sigma_deg: Vector3
    status: str
    mistake: str = ""


class SummaryLine(msgspec.Struct, tag="summary"):
    """The last line."""

    frames: int
    detections: int
    fixes: int
    dropped: dict[str, int]


KnownLine = HeaderLine | OriginLine | TargetLine | SightingLine | ClockEstimateLine | CalibrationLine | SummaryLine
KNOWN_TYPES = ("header", "origin", "target", "sighting", "clock", "calibration", "summary")


def read_lines(content: Iterable[bytes]) -> tuple[list[Line], int]:
    """The whole lines, and the number of damaged ones: a power cut leaves the last line in pieces.

    A line of an unknown type is kept as it is.
    """
    lines: list[Line] = []
    damaged = 0
    for encoded in content:
        if not encoded.strip():
            continue
        try:
            line = msgspec.json.decode(encoded, type=dict[str, object])
            if line.get("type") in KNOWN_TYPES:
                msgspec.convert(line, KnownLine)
            lines.append(line)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            damaged += 1
    return lines, damaged
