"""True positions of a mock vehicle, and the error of the estimated position at each sighting. Pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.recording.line_types import Line, SightingLine

HorizontalError = tuple[float, float]
"""North and east, estimate minus truth, metres."""


class TrueVehiclePath(msgspec.Struct, frozen=True):
    """True positions over time, linear between samples."""

    times_boot_s: Sequence[float]
    """Increasing times since the autopilot's boot, seconds."""
    positions_ned: Sequence[Vector3]
    """Position at each time, metres."""

    def at(self, time_boot_s: float) -> tuple[float, float] | None:
        """North and east at this time, metres; None outside the path."""
        after = bisect_left(self.times_boot_s, time_boot_s)
        if not 0 < after < len(self.times_boot_s):
            return None
        first, second = self.positions_ned[after - 1], self.positions_ned[after]
        first_s, second_s = self.times_boot_s[after - 1], self.times_boot_s[after]
        share = (time_boot_s - first_s) / (second_s - first_s)
        return first[0] + share * (second[0] - first[0]), first[1] + share * (second[1] - first[1])


def position_errors(lines: Iterable[Line], path: TrueVehiclePath) -> dict[int, list[HorizontalError]]:
    """Errors of the estimated position at the used sightings, by frame.

    The camera's position is used as the vehicle's: the demonstration's mock has its camera at the reference point.
    """
    errors: dict[int, list[HorizontalError]] = {}
    for line in lines:
        if isinstance(line, SightingLine) and line.reason is None and line.camera_ned is not None:
            true = None if line.time_boot is None else path.at(line.time_boot)
            if true is not None and line.frame is not None:
                error = (line.camera_ned[0] - true[0], line.camera_ned[1] - true[1])
                errors.setdefault(line.frame, []).append(error)
    return errors


def mean_position_error(
    errors: Mapping[int, Sequence[HorizontalError]], frames: Iterable[int] | None = None
) -> HorizontalError | None:
    """Mean error over the sightings of these frames, or of all; None without a sighting."""
    chosen = errors if frames is None else [frame for frame in frames if frame in errors]
    found = [error for frame in chosen for error in errors[frame]]
    if not found:
        return None
    return sum(north for north, _ in found) / len(found), sum(east for _, east in found) / len(found)
