"""The section about errors over time against the claimed 95 % radius, one chart per target. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from fwav_companion.tools.report.drawing import LinearAxes, Point, circle, drawing, polygon, polyline, thinned
from fwav_companion.tools.report.flight_data import FlightData
from fwav_companion.tools.report.page_elements import figure, key, section
from fwav_companion.tools.report.target_series import MOST_POINTS, SeriesPoint, TargetSeries

MOST_TARGETS = 12
"""Most charts: the targets with the most sightings."""
NEARLY_ALL = 0.97
"""Fraction of the values inside a chart's scale: the first claim may be a hundred times the later ones."""
MOST_SIGHTINGS = 600
"""Most sightings that one chart draws."""
PAUSE_S = 3.0
"""Longest time between two points of a line, seconds: two frames of a track are closer."""


def error_section(flight: FlightData) -> str:
    """A chart for each target; empty without a truth."""
    targets = [target for target in flight.targets if errors_of(target.points)]
    if not targets:
        return ""
    most_seen = sorted(targets, key=lambda target: -len(target.fixes))[:MOST_TARGETS]
    shown = [target for target in targets if target in most_seen]
    top_m = scale_top_m(shown)
    drawn = "".join(figure(target.name, error_chart(target, flight.seconds, top_m)) for target in shown)
    entries = [
        ("ours", "line", "error of the estimate"),
        ("claim", "area", "claimed: 95 % of the errors are in this area"),
        ("fix", "dot", "error of one sighting alone"),
    ]
    words = (
        "A correct claim keeps the line inside the area nearly always, and is not much wider than necessary. "
        "A line pauses while its target is out of view. All charts have the same scale."
    )
    left_out = len(targets) - len(shown)
    more = f"<p>{left_out} more targets with fewer sightings are in the table only.</p>" if left_out else ""
    heading = "Error over time, and the claimed 95 % radius"
    return section(heading, words, f'{key(entries)}<div class="grid">{drawn}</div>{more}')


def scale_top_m(targets: Sequence[TargetSeries]) -> float:
    """The top of a common scale for the charts of these targets, metres; larger values are drawn at the top."""
    claims = sorted(point.radius95_m for target in targets for point in target.points)
    errors = sorted(error_m for target in targets for _, error_m in errors_of(target.points))
    tops = [values[int(NEARLY_ALL * (len(values) - 1))] for values in (claims, errors) if values]
    return max(0.01, 1.15 * max(tops, default=1.0))


def error_chart(target: TargetSeries, seconds: float, top_m: float) -> str:
    """The error of one target over time, and its claimed 95 % radius."""
    axes = LinearAxes((0.0, max(seconds, 1.0)), (0.0, top_m))
    parts = axes.elements("seconds", "metres")
    for run in runs([(point.at_s, point.radius95_m) for point in target.points]):
        upper = [axes.at(t, r) for t, r in run]
        base = [(x, axes.at(0.0, 0.0)[1]) for x in (upper[-1][0], upper[0][0])]
        parts += [polygon([*upper, *base], "claim"), polyline(upper, "claim-edge")]
    sightings = thinned([(fix.at_s, fix.error_m) for fix in target.fixes if fix.error_m is not None], MOST_SIGHTINGS)
    parts += [circle(axes.at(*sighting), 1.7, "fix") for sighting in sightings]
    parts += strokes(axes, errors_of(target.points), "ours")
    return drawing(*axes.size, parts, f"Error of {target.name} over time")


def errors_of(points: Sequence[SeriesPoint]) -> list[Point]:
    """(seconds, error in metres) of the points with a known truth."""
    return [(point.at_s, point.error_m) for point in points if point.error_m is not None]


def strokes(axes: LinearAxes, points: Sequence[Point], kind: str) -> list[str]:
    """A line for each run of points, a dot for a single point."""
    drawn = []
    for run in runs(points):
        places = [axes.at(*point) for point in run]
        drawn.append(polyline(places, kind) if len(places) > 1 else circle(places[0], 1.5, kind))
    return drawn


def runs(points: Sequence[Point]) -> list[list[Point]]:
    """The points split at long pauses: no line joins two separate tracks."""
    if not points:
        return []
    pause_s = max(PAUSE_S, 3.0 * (points[-1][0] - points[0][0]) / MOST_POINTS)
    found = [[points[0]]]
    for before, point in pairwise(points):
        if point[0] - before[0] < pause_s:
            found[-1].append(point)
        else:
            found.append([point])
    return found
