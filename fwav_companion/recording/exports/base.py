"""What all exports share: they see each line of a targets file once, in order, and keep what they need of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from datetime import UTC, datetime
from math import atan2, cos, degrees, hypot, pi, sin, sqrt
from pathlib import Path, PurePath
from typing import Any, Final

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.recording.lines import Line
from fwav_companion.types import TrackState

BELIEVED: Final = (TrackState.CONFIRMED.value, TrackState.COASTING.value)
SCALE_90: Final = 2.145966
"""sqrt(chi-square, 2 degrees of freedom, 90 %): what a one-sigma ellipse is stretched by to hold nine of ten."""
CORNERS: Final = 48
"""Of an ellipse's polygon: no corner shows at any zoom of a map."""
PATH_EVERY_S: Final = 0.5
"""Between two points of a moving target's path."""
MOST_POINTS: Final = 100_000
"""Of all paths: half a day of one target."""


class Ellipse(msgspec.Struct, frozen=True):
    """One sigma of a horizontal position."""

    major_m: float
    minor_m: float
    bearing_deg: float
    """Of the major axis, from north through east, 0 to 180."""


def ellipse_from_cov(cov: Any) -> Ellipse:
    """Of the north and east part of a covariance, m^2."""
    nn, ne, ee = cov[0][0], 0.5 * (cov[0][1] + cov[1][0]), cov[1][1]
    middle, radius = 0.5 * (nn + ee), hypot(0.5 * (nn - ee), ne)
    bearing = 0.5 * atan2(2.0 * ne, nn - ee)
    return Ellipse(sqrt(max(0.0, middle + radius)), sqrt(max(0.0, middle - radius)), degrees(bearing) % 180.0)


class TargetTrack:
    """One target as it was believed: its last line, and where it went if it moves."""

    def __init__(self) -> None:
        self.last: Line = {}
        self.path: list[tuple[float, float]] = []
        """(latitude, longitude) in degrees."""
        self._path_time = 0.0

    def add(self, line: Line, *, may_grow: bool) -> bool:
        """The next line; True where the path grew."""
        self.last = line
        moves = line["vel"] is not None and line["lat"] is not None
        if not (moves and may_grow) or (self.path and line["time_unix"] - self._path_time < PATH_EVERY_S):
            return False
        self.path.append((line["lat"], line["lon"]))
        self._path_time = line["time_unix"]
        return True


class Export(ABC):
    """One file for another tool."""

    def __init__(self, path: PurePath) -> None:
        self.path = Path(path)

    @abstractmethod
    def add(self, line: Line) -> None:
        """The next line of the targets file."""

    @abstractmethod
    def content(self) -> bytes:
        """The whole file, when all lines were added."""


class MapExport(Export):
    """An export of the targets that were believed, by their last word."""

    def __init__(self, path: PurePath) -> None:
        super().__init__(path)
        self._tracks: dict[int, TargetTrack] = {}
        self._points = 0
        self._plane: TangentPlane | None = None

    def add(self, line: Line) -> None:
        """Targets that were confirmed once, and the origin."""
        if line["type"] in ("header", "origin") and line["origin"] is not None:
            origin = line["origin"]
            self._plane = TangentPlane(Geodetic.from_degrees(origin["lat"], origin["lon"], origin["alt_amsl"]))
        elif line["type"] == "target" and line["state"] in BELIEVED:
            track = self._tracks.setdefault(line["track"], TargetTrack())
            self._points += track.add(line, may_grow=self._points < MOST_POINTS)

    def tracks(self) -> Iterator[tuple[int, TargetTrack]]:
        """By number."""
        return iter(sorted(self._tracks.items()))

    def outline(self, line: Line) -> list[tuple[float, float]]:
        """(latitude, longitude) in degrees round the 90 % ellipse, counter-clockwise, the first point again at the end.

        Empty without a global position.
        """
        if self._plane is None or line["lat"] is None:
            return []
        ellipse = ellipse_from_cov(line["cov"])
        bearing = ellipse.bearing_deg * pi / 180.0
        corners = []
        for corner in range(CORNERS):
            angle = -2.0 * pi * corner / CORNERS
            along, across = SCALE_90 * ellipse.major_m * cos(angle), SCALE_90 * ellipse.minor_m * sin(angle)
            north = line["north"] + along * cos(bearing) - across * sin(bearing)
            east = line["east"] + along * sin(bearing) + across * cos(bearing)
            place = self._plane.geodetic_from_ned((north, east, line["down"]))
            corners.append((place.lat_deg, place.lon_deg))
        return [*corners, corners[0]]


def utc_text(time_unix: float) -> str:
    """ISO 8601, as far as the recording's clock was UTC; "" beyond the calendar."""
    try:
        return datetime.fromtimestamp(time_unix, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    except (OverflowError, ValueError, OSError):
        return ""
