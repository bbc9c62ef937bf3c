"""Time series of each target: estimates, claims, errors against the truth, and other variants' estimates. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

import msgspec

from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.recording.line_types import Line
from fwav_companion.tools.report.true_vehicle_path import HorizontalError

MOST_POINTS = 500
"""Most points of one series: finer than a chart's pixels, and the 95 % radius of each costs a millisecond."""


class SeriesPoint(msgspec.Struct, frozen=True):
    """The estimate of a target at one frame."""

    at_s: float
    """Seconds since the start of the recording."""
    north: float
    east: float
    radius95_m: float
    """Radius of the circle that is claimed to hold the target with 95 %, metres."""
    error_m: float | None
    """Horizontal error, metres; None without a truth."""


class SeriesFix(msgspec.Struct, frozen=True):
    """One sighting on the ground."""

    at_s: float
    north: float
    east: float
    error_m: float | None


class VariantSeries(msgspec.Struct, frozen=True):
    """The estimates of one target in another variant of the tracker."""

    name: str
    kind: str
    """Colour class."""
    points: list[SeriesPoint]
    """Estimates while the target was confirmed; empty: never."""

    @property
    def last(self) -> SeriesPoint | None:
        """The final estimate."""
        return self.points[-1] if self.points else None


class TargetSeries(msgspec.Struct, frozen=True, kw_only=True):
    """Everything about one target, or about a ghost: a confirmed track without a true target of its own."""

    name: str
    """Unique name for people; it has the track's number where several targets share the label."""
    points: list[SeriesPoint]
    """Estimates while the target was confirmed, else of its newest track; thinned where there are many."""
    fixes: list[SeriesFix]
    cov: Matrix3 | None
    """Covariance of the final estimate, m^2, NED."""
    found: bool
    """Whether the target was confirmed and is not a ghost."""
    ghost: bool
    """Whether the track is confirmed, truths are known, and not one of them is its own."""
    true_ned: tuple[float, float] | None
    """True north and east at the end, metres."""
    position_error_m: HorizontalError | None
    """Mean error of the vehicle's position while the target was seen, metres; None where it is not known."""
    place: tuple[float, float] | None
    """Latitude and longitude of the final estimate, degrees."""
    variants: list[VariantSeries]

    @property
    def last(self) -> SeriesPoint | None:
        """The final estimate."""
        return self.points[-1] if self.points else None

    @property
    def relative_ned(self) -> tuple[float, float] | None:
        """North and east of the final estimate without the error of the vehicle's position, metres."""
        if self.last is None or self.position_error_m is None:
            return None
        return self.last.north - self.position_error_m[0], self.last.east - self.position_error_m[1]

    @property
    def relative_error_m(self) -> float | None:
        """Final error relative to the vehicle, metres; None where it is not known."""
        relative_ned = self.relative_ned
        if relative_ned is None or self.true_ned is None:
            return None
        return hypot(relative_ned[0] - self.true_ned[0], relative_ned[1] - self.true_ned[1])

    @property
    def title(self) -> str:
        """The name, and whether the target is a ghost or was not found."""
        if self.found:
            return self.name
        return f"{self.name} ({'ghost' if self.ghost else 'not found'})"


class ReplayedLines(msgspec.Struct, frozen=True):
    """The lines of one replay with the name and colour class of its variant."""

    name: str
    kind: str
    lines: Sequence[Line]
