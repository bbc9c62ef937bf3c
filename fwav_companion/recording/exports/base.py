"""Base classes of the exports: they take each line of a targets file once, in order."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime
from math import degrees, log, sqrt
from pathlib import Path, PurePath
from typing import Final

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.ellipses import ellipse_outline, semi_axes
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.recording.labels import display_names
from fwav_companion.recording.line_types import HeaderLine, Line, OriginLine, TargetLine

SHARE: Final = 0.95
"""Probability of every ellipse and interval in an export."""
SCALE_95: Final = sqrt(-2.0 * log(1.0 - SHARE))
"""Semi-axes of the 95 % ellipse in sigmas: chi-square quantile with 2 degrees of freedom."""
PATH_EVERY_S: Final = 0.5
"""Time between two points of a moving target's path, seconds."""
MOST_POINTS: Final = 100_000
"""Most points of all paths together: half a day of one target."""


class Ellipse95(msgspec.Struct, frozen=True):
    """The ellipse that contains a target with a probability of 95 %."""

    major_m: float
    """Larger semi-axis, metres."""
    minor_m: float
    """Smaller semi-axis, metres."""
    bearing_deg: float
    """Direction of the larger semi-axis from north through east, degrees, 0 to 180."""


def ellipse95(cov: Matrix3) -> Ellipse95:
    """The 95 % ellipse of a covariance, m^2, NED."""
    larger, smaller, bearing = semi_axes(cov)
    return Ellipse95(SCALE_95 * larger, SCALE_95 * smaller, degrees(bearing) % 180.0)


class ExportedTrack:
    """A confirmed track: its last line, and its path if it moves."""

    def __init__(self, first: TargetLine) -> None:
        self.last = first
        self.path: list[tuple[float, float]] = []
        """Points of the path: (latitude, longitude), degrees."""
        self._path_time = 0.0

    def add(self, line: TargetLine, *, may_grow: bool) -> bool:
        """Add the next line. Returns whether the path grew."""
        self.last = line
        if line.vel is None or line.lat_lon is None or not may_grow:
            return False
        if self.path and line.time_unix - self._path_time < PATH_EVERY_S:
            return False
        self.path.append(line.lat_lon)
        self._path_time = line.time_unix
        return True


class Export(ABC):
    """A file for another tool."""

    def __init__(self, path: PurePath) -> None:
        self.path = Path(path)

    @abstractmethod
    def add(self, line: Line) -> None:
        """Add the next line of the targets file."""

    @abstractmethod
    def content(self) -> bytes:
        """The file after the last line."""


class MapExport(Export):
    """An export of the confirmed tracks, each by its last line."""

    def __init__(self, path: PurePath) -> None:
        super().__init__(path)
        self._tracks: dict[int, ExportedTrack] = {}
        self._points = 0
        self._plane: TangentPlane | None = None

    def add(self, line: Line) -> None:
        """Keep the lines of confirmed tracks, and the origin."""
        if isinstance(line, HeaderLine | OriginLine) and line.origin is not None:
            self._plane = line.origin.plane
        elif isinstance(line, TargetLine) and line.is_confirmed:
            track = self._tracks.setdefault(line.track, ExportedTrack(line))
            self._points += track.add(line, may_grow=self._points < MOST_POINTS)

    def tracks(self) -> Iterator[tuple[str, int, ExportedTrack]]:
        """(name, track number, track), by number. The name contains the number where several tracks share a label."""
        labels = [track.last.label for track in self._tracks.values()]
        names, count = display_names(labels), Counter(labels)
        for number, track in sorted(self._tracks.items()):
            label = track.last.label
            yield names[label] if count[label] == 1 else f"{names[label]} #{number}", number, track

    def outline(self, line: TargetLine) -> list[tuple[float, float]]:
        """(latitude, longitude) of the 95 % ellipse, degrees, counter-clockwise and closed.

        Empty without a global position.
        """
        if self._plane is None or line.lat_lon is None:
            return []
        corners = []
        for north, east in reversed(ellipse_outline(line.north, line.east, line.cov, SHARE)):
            place = self._plane.geodetic_from_ned((north, east, line.down))
            corners.append((place.lat_deg, place.lon_deg))
        return [*corners, corners[0]]


def utc_text(time_unix: float) -> str:
    """ISO 8601 time; it is UTC as far as the recording's clock was. "" for times outside the calendar."""
    try:
        return datetime.fromtimestamp(time_unix, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    except (OverflowError, ValueError, OSError):
        return ""
