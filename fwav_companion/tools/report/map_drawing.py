"""The map of a flight, north up: path, sightings, estimates with their 95 % ellipses, and the truth. Pure."""

from __future__ import annotations

from collections.abc import Callable

from fwav_companion.geometry.ellipses import ellipse_outline
from fwav_companion.tools.report.drawing import (
    Point,
    circle,
    cross,
    drawing,
    line,
    polygon,
    polyline,
    text,
    thinned,
    ticks,
)
from fwav_companion.tools.report.flight_data import FlightData
from fwav_companion.tools.report.target_series import TargetSeries
from fwav_companion.tools.report.wording import length

MOST_POINTS = 600
MAP_SIZE = 480.0
"""Width and height of the map in SVG units."""
MIN_SPAN_M = 2.0
LETTER = 8.0
"""Width of a wide letter of a target's name in SVG units."""


def flight_map(flight: FlightData, other: FlightData | None = None) -> str:
    """The map; with ``other``, a second flight on its own map, both maps show the same ground."""
    points = _extent(flight)
    if not points:
        return ""
    if other is not None and other.origin == flight.origin:
        points += _extent(other)
    norths, easts = [north for north, _ in points], [east for _, east in points]
    middle = ((min(norths) + max(norths)) / 2, (min(easts) + max(easts)) / 2)
    span = 1.06 * max(max(norths) - min(norths), max(easts) - min(easts), MIN_SPAN_M)
    scale = MAP_SIZE / span

    def at(place: Point) -> Point:
        return MAP_SIZE / 2 + (place[1] - middle[1]) * scale, MAP_SIZE / 2 - (place[0] - middle[0]) * scale

    parts = _grid(middle, span, scale)
    for part in flight.path:
        parts.append(polyline((at(place) for place in thinned(part, MOST_POINTS)), "path"))
    if flight.path:
        parts.append(circle(at(flight.path[0][0]), 4, "path-start", "the vehicle at the start"))
    for target in flight.targets:
        parts += [circle(at((fix.north, fix.east)), 1.6, "fix") for fix in target.fixes[:MOST_POINTS]]
    for landmark in flight.landmarks:
        parts.append(circle(at((landmark.north, landmark.east)), 6, "landmark", f"{landmark.label}: {landmark.result}"))
    for target in flight.targets:
        parts += _target(target, at)
    parts += _scale_bar(scale)
    return drawing(MAP_SIZE, MAP_SIZE, parts, "Map of the flight from above, north up")


def _extent(flight: FlightData) -> list[Point]:
    """Places that the map must contain: the path, the truths, and the 95 % circles."""
    points = [place for part in flight.path for place in part]
    for target in flight.targets:
        if target.true_ned:
            points.append(target.true_ned)
        if target.last:
            n, e, r = target.last.north, target.last.east, target.last.radius95_m
            points += [(n - r, e - r), (n + r, e + r)]
    return points


def _grid(middle: Point, span: float, scale: float) -> list[str]:
    half = span / 2
    parts = []
    for north in ticks(middle[0] - half, middle[0] + half, 5):
        y = MAP_SIZE / 2 - (north - middle[0]) * scale
        parts.append(line((0, y), (MAP_SIZE, y), "grid"))
        if y > 40:
            parts.append(text((4, y - 3), f"{north:g}", "tick"))
    for east in ticks(middle[1] - half, middle[1] + half, 5):
        x = MAP_SIZE / 2 + (east - middle[1]) * scale
        parts += [line((x, 0), (x, MAP_SIZE), "grid"), text((x + 3, MAP_SIZE - 4), f"{east:g}", "tick")]
    return parts


def _target(target: TargetSeries, at: Callable[[Point], Point]) -> list[str]:
    parts = []
    if target.true_ned:
        parts.append(cross(at(target.true_ned), 6, "truth"))
    last = target.last
    if last and target.cov:
        place = at((last.north, last.east))
        parts.append(polygon(map(at, ellipse_outline(last.north, last.east, target.cov, 0.95)), "ellipse"))
        if target.relative_ned is not None:
            parts.append(circle(at(target.relative_ned), 3.5, "relative", "estimate without the error of the GNSS"))
        error = f", error {length(last.error_m)}" if last.error_m is not None else ""
        parts.append(circle(place, 4, "estimate", f"{target.title}: within {length(last.radius95_m)} (95 %){error}"))
        parts.append(_name(place, target.title))
    elif target.true_ned:
        parts.append(_name(at(target.true_ned), target.title))
    return parts


def _name(at: Point, name: str) -> str:
    """The name to the right of a dot, or to its left where the map ends."""
    fits = at[0] + 8 + LETTER * len(name) < MAP_SIZE
    return text((at[0] + (8 if fits else -8), at[1] - 7), name, "label", "start" if fits else "end")


def _scale_bar(scale: float) -> list[str]:
    length_m = ticks(0.0, MAP_SIZE / scale, 5)[1]
    end = MAP_SIZE - 16
    start = end - length_m * scale
    return [
        line((start, 20), (end, 20), "bar"), line((start, 16), (start, 24), "bar"), line((end, 16), (end, 24), "bar"),
        text(((start + end) / 2, 36), f"{length_m:g} m", "name", "middle"),
        text((16, 26), "N ↑", "name"),
    ]  # fmt: skip
