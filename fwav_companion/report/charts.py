"""The report's drawings: map, errors over time, clock, gaps, the picture. Pure."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Sequence
from html import escape
from math import cos, pi, sin, sqrt

from fwav_companion.geometry.ellipses import semi_axes
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.report.story import ClockPoint, Course, PictureShown, Story
from fwav_companion.report.svg import (
    Point,
    circle,
    cross,
    drawing,
    line,
    number,
    polygon,
    polyline,
    text,
    thinned,
    ticks,
    told_number,
)

ELLIPSE_95 = sqrt(5.991464547107979)
"""Chi-square of two degrees of freedom at 95 %: the ellipse of this many sigmas holds as much."""
MOST_POINTS = 600
MAP_SIZE = 480.0
CHART_WIDTH, CHART_HEIGHT = 360.0, 210.0
LEFT, RIGHT, TOP, BOTTOM = 40.0, 8.0, 12.0, 30.0


class Frame:
    """A chart's axes: data to pixels."""

    def __init__(self, x: tuple[float, float], y: tuple[float, float], size: Point) -> None:
        self.x, self.y, self.size = x, y, size

    def at(self, x: float, y: float) -> Point:
        """In the drawing; what is beyond the top stays at it."""
        (x0, x1), (y0, y1), (width, height) = self.x, self.y, self.size
        across = LEFT + (x - x0) / (x1 - x0) * (width - LEFT - RIGHT)
        up = height - BOTTOM - (min(y, y1) - y0) / (y1 - y0) * (height - TOP - BOTTOM)
        return across, up

    def axes(self, x_name: str, y_name: str, y_ticks: int = 4) -> list[str]:
        """Grid, numbers, names."""
        parts = []
        for value in ticks(*self.y, y_ticks):
            left, right = self.at(self.x[0], value), self.at(self.x[1], value)
            parts += [line(left, right, "grid"), text((LEFT - 6, left[1] + 4), told_number(value), "tick", "end")]
        bottom = self.size[1] - BOTTOM
        for value in ticks(*self.x, 6):
            x = self.at(value, self.y[0])[0]
            parts += [
                line((x, bottom), (x, bottom + 4), "axis"),
                text((x, bottom + 16), told_number(value), "tick", "middle"),
            ]
        parts.append(line((LEFT, bottom), (self.size[0] - RIGHT, bottom), "axis"))
        parts.append(text((self.size[0] - RIGHT, self.size[1] - 2), x_name, "name", "end"))
        parts.append(text((LEFT, TOP - 2), y_name, "name"))
        return parts


def flight_map(story: Story) -> str:
    """From above: the way flown, what is true, what was seen, what was concluded and how surely."""
    points = _everything(story)
    if not points:
        return ""
    norths, easts = [north for north, _ in points], [east for _, east in points]
    middle = ((min(norths) + max(norths)) / 2, (min(easts) + max(easts)) / 2)
    span = 1.06 * max(max(norths) - min(norths), max(easts) - min(easts), 2.0)
    scale = MAP_SIZE / span

    def at(place: Point) -> Point:
        return MAP_SIZE / 2 + (place[1] - middle[1]) * scale, MAP_SIZE / 2 - (place[0] - middle[0]) * scale

    parts = _map_grid(middle, span, at_scale=scale)
    parts.append(polyline(map(at, thinned(story.path, MOST_POINTS)), "path"))
    if story.path:
        parts.append(circle(at(story.path[0]), 4, "path-start", "the vehicle at the start"))
    for course in story.courses:
        parts += [circle(at((fix.north, fix.east)), 1.6, "fix") for fix in course.fixes[:MOST_POINTS]]
    for course in story.courses:
        parts += _map_target(course, at)
    parts += _scale_bar(scale)
    return drawing(MAP_SIZE, MAP_SIZE, parts, "Map of the flight from above, north up")


def _everything(story: Story) -> list[Point]:
    """All that the map should hold, with the ellipses' reach."""
    points = list(story.path)
    for course in story.courses:
        if course.true_ned:
            points.append(course.true_ned)
        if course.last:
            n, e, r = course.last.north, course.last.east, course.last.radius95_m
            points += [(n - r, e - r), (n + r, e + r)]
    return points


def _map_grid(middle: Point, span: float, at_scale: float) -> list[str]:
    half = span / 2
    parts = []
    for north in ticks(middle[0] - half, middle[0] + half, 5):
        y = MAP_SIZE / 2 - (north - middle[0]) * at_scale
        parts.append(line((0, y), (MAP_SIZE, y), "grid"))
        if y > 40:
            parts.append(text((4, y - 3), f"{north:g}", "tick"))
    for east in ticks(middle[1] - half, middle[1] + half, 5):
        x = MAP_SIZE / 2 + (east - middle[1]) * at_scale
        parts += [line((x, 0), (x, MAP_SIZE), "grid"), text((x + 3, MAP_SIZE - 4), f"{east:g}", "tick")]
    return parts


def _map_target(course: Course, at: Callable[[Point], Point]) -> list[str]:
    parts = []
    if course.true_ned:
        parts.append(cross(at(course.true_ned), 6, "truth"))
    last = course.last
    if last and course.cov:
        parts.append(polygon(map(at, ellipse(last.north, last.east, course.cov)), "ellipse"))
        error = f", {last.error_m:.2f} m off" if last.error_m is not None else ""
        told = f"{course.label}: within {last.radius95_m:.2f} m (95 %){error}"
        parts.append(circle(at((last.north, last.east)), 4, "estimate", told))
        x, y = at((last.north, last.east))
        parts.append(text((x + 8, y - 7), short(course.label), "label"))
    elif course.true_ned:
        x, y = at(course.true_ned)
        parts.append(text((x + 8, y - 7), f"{short(course.label)} (not found)", "label"))
    return parts


def _scale_bar(scale: float) -> list[str]:
    length_m = ticks(0.0, MAP_SIZE / scale, 5)[1]
    end = MAP_SIZE - 16
    start = end - length_m * scale
    return [
        line((start, 20), (end, 20), "bar"), line((start, 16), (start, 24), "bar"), line((end, 16), (end, 24), "bar"),
        text(((start + end) / 2, 36), f"{length_m:g} m", "name", "middle"),
        text((16, 26), "N ↑", "name"),
    ]  # fmt: skip


def ellipse(north: float, east: float, cov: Matrix3) -> list[Point]:
    """(north, east) along the ellipse that holds 95 %."""
    larger, smaller, bearing = semi_axes(cov)
    outline = []
    for index in range(48):
        angle = 2.0 * pi * index / 48
        along, across = ELLIPSE_95 * larger * cos(angle), ELLIPSE_95 * smaller * sin(angle)
        outline.append(
            (north + along * cos(bearing) - across * sin(bearing), east + along * sin(bearing) + across * cos(bearing))
        )
    return outline


def short(label: str) -> str:
    """How a person would call it."""
    family, _, tag = label.rpartition(":")
    return f"tag {tag}" if family.startswith("tag") else label


def error_chart(course: Course, seconds: float, top_m: float) -> str:
    """Error over time of one target, against what was claimed, with the other filter beside it."""
    frame = Frame((0.0, max(seconds, 1.0)), (0.0, top_m), (CHART_WIDTH, CHART_HEIGHT))
    parts = frame.axes("seconds", "metres")
    claimed = [(instant.at_s, instant.radius95_m) for instant in course.instants]
    for run in _runs(claimed):
        upper = [frame.at(t, r) for t, r in thinned(run, MOST_POINTS)]
        base = [(x, frame.at(0.0, 0.0)[1]) for x in (upper[-1][0], upper[0][0])]
        parts += [polygon([*upper, *base], "claim"), polyline(upper, "claim-edge")]
    parts += [circle(frame.at(fix.at_s, fix.error_m), 1.7, "fix") for fix in course.fixes if fix.error_m is not None]
    for kind, instants in (("other", course.other), ("ours", course.instants)):
        errors = [(one.at_s, one.error_m) for one in instants if one.error_m is not None]
        parts += [polyline((frame.at(*point) for point in thinned(run, MOST_POINTS)), kind) for run in _runs(errors)]
    return drawing(CHART_WIDTH, CHART_HEIGHT, parts, f"Error of {short(course.label)} over time")


def _runs(points: Sequence[Point]) -> list[list[Point]]:
    """Parts without a long pause: between two tracks there is no line."""
    runs: list[list[Point]] = []
    for point in points:
        if runs and point[0] - runs[-1][-1][0] < 3.0:
            runs[-1].append(point)
        else:
            runs.append([point])
    return runs


def clock_chart(points: Sequence[ClockPoint], seconds: float) -> str:
    """How well the autopilot's clock was placed on ours."""
    top_ms = max([1.0, *(1.15e3 * point.bound_s for point in points[1:])])
    frame = Frame((0.0, max(seconds, 1.0)), (0.0, top_ms), (CHART_WIDTH, CHART_HEIGHT))
    bound = [frame.at(point.at_s, point.bound_s * 1e3) for point in points]
    sigma = [frame.at(point.at_s, point.sigma_s * 1e3) for point in points]
    parts = [*frame.axes("seconds", "milliseconds"), polyline(bound, "bound"), polyline(sigma, "ours")]
    return drawing(CHART_WIDTH, CHART_HEIGHT, parts, "Uncertainty of the autopilot's clock over time")


def gaps_chart(gaps_s: Sequence[float]) -> str:
    """How far each used detection was from the nearest attitude."""
    if not gaps_s:
        return ""
    top_ms = max(5.0, max(gaps_s) * 1e3)
    bins = 20
    counts = [0] * bins
    for gap_s in gaps_s:
        counts[min(bins - 1, int(gap_s * 1e3 / top_ms * bins))] += 1
    frame = Frame((0.0, top_ms), (0.0, max(counts) * 1.1), (CHART_WIDTH, CHART_HEIGHT))
    parts = frame.axes("milliseconds to the nearest attitude", "detections")
    for index, count in enumerate(counts):
        left, right = index * top_ms / bins, (index + 1) * top_ms / bins
        a, b, base = frame.at(left, count), frame.at(right, count), frame.at(left, 0.0)[1]
        parts.append(polygon([(a[0] + 1, base), (a[0] + 1, a[1]), (b[0] - 1, b[1]), (b[0] - 1, base)], "bar-fill"))
    return drawing(CHART_WIDTH, CHART_HEIGHT, parts, "Detections by their distance in time from an attitude")


def picture(shown: PictureShown) -> str:
    """The frame, with boxes, centres and labels over it."""
    width, height = shown.size
    data = b64encode(shown.jpeg).decode()
    parts = [f'<image href="data:image/jpeg;base64,{data}" width="{width}" height="{height}"/>']
    for found in shown.detections:
        u, v = found["u"] + 0.5, found["v"] + 0.5
        if found.get("box"):
            left, top, right, bottom = (side + 0.5 for side in found["box"])
            box = f'x="{number(left)}" y="{number(top)}" width="{number(right - left)}" height="{number(bottom - top)}"'
            parts.append(f'<rect class="box" {box}/>')
            above = top - 8 if top > 30 else bottom + 22
            parts.append(text((left, above), short(str(found.get("label", ""))), "box-label"))
        parts.append(cross((u, v), 9, "aim"))
    return drawing(width, height, parts, f"Frame {shown.frame} with its detections")


def budget_bars(budget_m: dict[str, float], names: dict[str, str]) -> str:
    """What a single fix's uncertainty is made of, as rows of HTML."""
    if not budget_m:
        return ""
    most = max(budget_m.values()) or 1.0
    rows = []
    for cause, sigma_m in sorted(budget_m.items(), key=lambda item: -item[1]):
        if sigma_m < 0.005:
            continue
        share = f"{100.0 * sigma_m / most:.1f}%"
        rows.append(
            f'<div class="bar-row"><span>{escape(names.get(cause, cause))}</span>'
            f'<span class="track"><i style="width:{share}"></i></span><b>{sigma_m:.2f} m</b></div>'
        )
    return "".join(rows)
