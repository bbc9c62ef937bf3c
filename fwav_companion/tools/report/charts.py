"""The report's small charts: errors against their claims, clocks, gaps. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from fwav_companion.tools.report.axes import Frame
from fwav_companion.tools.report.courses import MOST_INSTANTS, Course, Instant
from fwav_companion.tools.report.story import ClockPoint
from fwav_companion.tools.report.svg import Point, circle, drawing, polygon, polyline, thinned
from fwav_companion.tools.report.words import short

MOST_POINTS = 600
PAUSE_S = 3.0
"""Between two frames of one track lies less."""


def error_chart(course: Course, seconds: float, top_m: float) -> str:
    """Error over time of one target, against what was claimed."""
    frame = Frame((0.0, max(seconds, 1.0)), (0.0, top_m))
    parts = frame.axes("seconds", "metres")
    claimed = [(instant.at_s, instant.radius95_m) for instant in course.instants]
    for run in runs(claimed):
        upper = [frame.at(t, r) for t, r in run]
        base = [(x, frame.at(0.0, 0.0)[1]) for x in (upper[-1][0], upper[0][0])]
        parts += [polygon([*upper, *base], "claim"), polyline(upper, "claim-edge")]
    sightings = thinned([(fix.at_s, fix.error_m) for fix in course.fixes if fix.error_m is not None], MOST_POINTS)
    parts += [circle(frame.at(*sighting), 1.7, "fix") for sighting in sightings]
    parts += strokes(frame, errors_of(course.instants), "ours")
    return drawing(*frame.size, parts, f"Error of {short(course.label)} over time")


def errors_of(instants: Sequence[Instant]) -> list[Point]:
    """(seconds, metres) where a truth is known."""
    return [(one.at_s, one.error_m) for one in instants if one.error_m is not None]


def strokes(frame: Frame, points: Sequence[Point], kind: str) -> list[str]:
    """A line for each run; a dot where it is a single point."""
    drawn = []
    for run in runs(points):
        places = [frame.at(*point) for point in run]
        drawn.append(polyline(places, kind) if len(places) > 1 else circle(places[0], 1.5, kind))
    return drawn


def runs(points: Sequence[Point]) -> list[list[Point]]:
    """Parts without a long pause: between two tracks there is no line."""
    if not points:
        return []
    pause_s = max(PAUSE_S, 3.0 * (points[-1][0] - points[0][0]) / MOST_INSTANTS)
    found = [[points[0]]]
    for before, point in pairwise(points):
        if point[0] - before[0] < pause_s:
            found[-1].append(point)
        else:
            found.append([point])
    return found


def clock_chart(points: Sequence[ClockPoint], seconds: float) -> str:
    """How well the autopilot's clock was placed on ours."""
    top_ms = max([1.0, *(1.15e3 * point.bound_s for point in points[1:])])
    frame = Frame((0.0, max(seconds, 1.0)), (0.0, top_ms))
    bound = [frame.at(point.at_s, point.bound_s * 1e3) for point in points]
    sigma = [frame.at(point.at_s, point.sigma_s * 1e3) for point in points]
    parts = [*frame.axes("seconds", "milliseconds"), polyline(bound, "bound"), polyline(sigma, "ours")]
    return drawing(*frame.size, parts, "Uncertainty of the autopilot's clock over time")


def gaps_chart(gaps_s: Sequence[float]) -> str:
    """How far each used detection was from the nearest attitude."""
    if not gaps_s:
        return ""
    top_ms = max(5.0, max(gaps_s) * 1e3)
    bins = 20
    counts = [0] * bins
    for gap_s in gaps_s:
        counts[min(bins - 1, int(gap_s * 1e3 / top_ms * bins))] += 1
    frame = Frame((0.0, top_ms), (0.0, max(counts) * 1.1))
    parts = frame.axes("milliseconds to the nearest attitude", "detections")
    for index, count in enumerate(counts):
        left, right = index * top_ms / bins, (index + 1) * top_ms / bins
        a, b, base = frame.at(left, count), frame.at(right, count), frame.at(left, 0.0)[1]
        parts.append(polygon([(a[0] + 1, base), (a[0] + 1, a[1]), (b[0] - 1, b[1]), (b[0] - 1, base)], "bar-fill"))
    return drawing(*frame.size, parts, "Detections by their distance in time from an attitude")
