"""The map: from above, north up. Pure."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin, sqrt

from fwav_companion.geometry.ellipses import semi_axes
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.tools.report.courses import Course
from fwav_companion.tools.report.story import Story
from fwav_companion.tools.report.svg import Point, circle, cross, drawing, line, polygon, polyline, text, thinned, ticks
from fwav_companion.tools.report.words import length, short

ELLIPSE_95 = sqrt(5.991464547107979)
"""Chi-square of two degrees of freedom at 95 %: the ellipse of this many sigmas holds as much."""
MOST_POINTS = 600
MAP_SIZE = 480.0
LETTER = 8.0
"""Of a label, wide ones among them."""


def flight_map(story: Story, beside: Story | None = None) -> str:
    """From above: the way flown, what is true, what was seen, what was concluded and how surely.

    ``beside``: what stands on another map, which shall show the same ground.
    """
    points = _everything(story)
    if not points:
        return ""
    if beside is not None and beside.origin == story.origin:
        points += _everything(beside)
    norths, easts = [north for north, _ in points], [east for _, east in points]
    middle = ((min(norths) + max(norths)) / 2, (min(easts) + max(easts)) / 2)
    span = 1.06 * max(max(norths) - min(norths), max(easts) - min(easts), 2.0)
    scale = MAP_SIZE / span

    def at(place: Point) -> Point:
        return MAP_SIZE / 2 + (place[1] - middle[1]) * scale, MAP_SIZE / 2 - (place[0] - middle[0]) * scale

    parts = _map_grid(middle, span, at_scale=scale)
    for stretch in story.path:
        parts.append(polyline((at(place) for place in thinned(stretch, MOST_POINTS)), "path"))
    if story.path:
        parts.append(circle(at(story.path[0][0]), 4, "path-start", "the vehicle at the start"))
    for course in story.courses:
        parts += [circle(at((fix.north, fix.east)), 1.6, "fix") for fix in course.fixes[:MOST_POINTS]]
    for course in story.courses:
        parts += _map_target(course, at)
    parts += _scale_bar(scale)
    return drawing(MAP_SIZE, MAP_SIZE, parts, "Map of the flight from above, north up")


def _everything(story: Story) -> list[Point]:
    """All that the map should hold, with the ellipses' reach."""
    points = [place for stretch in story.path for place in stretch]
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
        error = f", {length(last.error_m)} off" if last.error_m is not None else ""
        told = f"{course.label}: within {length(last.radius95_m)} (95 %){error}"
        parts.append(circle(at((last.north, last.east)), 4, "estimate", told))
        parts.append(_label(at((last.north, last.east)), short(course.label)))
    elif course.true_ned:
        parts.append(_label(at(course.true_ned), f"{short(course.label)} (not found)"))
    return parts


def _label(at: Point, told: str) -> str:
    """Beside a dot: to its right, unless the map ends there."""
    fits = at[0] + 8 + LETTER * len(told) < MAP_SIZE
    return text((at[0] + (8 if fits else -8), at[1] - 7), told, "label", "start" if fits else "end")


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
