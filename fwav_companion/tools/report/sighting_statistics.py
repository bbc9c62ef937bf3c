"""Statistics of a replay's sighting lines: path, height, error budget, and counts of what was refused. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import median

from fwav_companion.recording.line_types import SightingLine
from fwav_companion.tools.reason_table import reasons_of

CAUSES = ("position", "heading", "attitude", "mount", "height", "time", "pixel", "terrain", "target")
"""Causes in the error budget of a fix, as a recording names them."""
ALONG_A_LINE = ("heading", "height", "time", "terrain", "target")
"""Causes that move a fix along a line: about the vehicle, along the ray, along the path."""
ROUND_95, LINE_95 = 1.7308, 1.9600
"""Radius that holds 95 % of the errors, in units of sqrt(trace of the horizontal covariance): sqrt(5.991 / 2) where the
error is equal in all directions, the normal quantile where it lies along a line. Every other ellipse is in between."""
PATH_GAP_S = 1.0
"""Time without a sighting that splits the estimated path, seconds."""


def estimated_path(used: Sequence[SightingLine]) -> list[list[tuple[float, float]]]:
    """Estimated camera positions at the used sightings, north and east, split where sightings pause."""
    parts: list[list[tuple[float, float]]] = []
    last_s = float("-inf")
    for line in used:
        if line.camera_ned and line.time_boot is not None:
            if abs(line.time_boot - last_s) > PATH_GAP_S:
                parts.append([])
            parts[-1].append((line.camera_ned[0], line.camera_ned[1]))
            last_s = line.time_boot
    return parts


def height_m(used: Sequence[SightingLine]) -> float | None:
    """Median height of the camera above the ground at the used sightings, metres; None without one."""
    places = [(line.camera_ned, line.ground_ned) for line in used if line.camera_ned]
    heights = [ground[2] - camera[2] for camera, ground in places if ground is not None]
    return median(heights) if heights else None


def budget95_m(used: Sequence[SightingLine]) -> dict[str, float]:
    """Radius that holds 95 % of a sighting's errors from each cause, metres; empty without an error budget.

    A budget is sqrt(trace of the cause's horizontal covariance); its root mean square over the sightings counts.
    """
    budgets = [line.budget for line in used if line.budget]
    if not budgets:
        return {}
    return {
        cause: (LINE_95 if cause in ALONG_A_LINE else ROUND_95)
        * (sum((getattr(each, cause) or 0.0) ** 2 for each in budgets) / len(budgets)) ** 0.5
        for cause in CAUSES
    }


def refused_frames(sightings: Sequence[SightingLine], dropped: Mapping[str, int]) -> dict[str, int]:
    """Number of whole frames that were refused, by reason; ``dropped``: of the summary."""
    alone = refused_detections(sightings, dropped)
    return {reason: count for reason, count in dropped.items() if reason not in alone}


def refused_detections(sightings: Sequence[SightingLine], dropped: Mapping[str, int]) -> dict[str, int]:
    """Number of single detections that were refused, in frames that were not, by reason.

    The summary counts both under the same names. A refused frame counts once there, and each of its detections has a
    sighting line. One reason occurs in both ways (``not_finite``: a pixel or a stamp); it counts as detections where
    each has its sighting line.
    """
    lines, of_frames = Counter(line.reason for line in sightings), reasons_of("frame")
    return {
        reason: count
        for reason, count in dropped.items()
        if reason not in of_frames and (not sightings or lines[reason] == count)
    }
