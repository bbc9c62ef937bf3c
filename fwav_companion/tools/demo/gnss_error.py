"""By how much the vehicle's position was off whenever it saw something: what all its answers have in common. Pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from fwav_companion.recording.lines import Line


def mean_position_error_m(lines: Iterable[Line], truth: Sequence[Mapping[str, Any]]) -> tuple[float, float] | None:
    """North, east: believed minus true, on the mean over the sightings that were used. None where nothing tells.

    ``truth``: the mock's lines; those of the vehicle come at a steady rate, and its path is straight between them.
    """
    told = [line for line in truth if line["type"] == "vehicle"]
    times = [line["boot_ns"] * 1e-9 for line in told]
    errors = []
    for line in lines:
        if line["type"] == "sighting" and line["reason"] is None and line["camera_ned"] is not None:
            after = bisect_left(times, line["time_boot"])
            if 0 < after < len(times):
                share = (line["time_boot"] - times[after - 1]) / (times[after] - times[after - 1])
                before, then = told[after - 1]["position"], told[after]["position"]
                errors.append([line["camera_ned"][axis] - before[axis] - share * (then[axis] - before[axis])
                               for axis in (0, 1)])  # fmt: skip
    if not errors:
        return None
    return sum(north for north, _ in errors) / len(errors), sum(east for _, east in errors) / len(errors)
