"""The section about a landing: path over the pad, offset over height, what was withheld, what was said. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from math import isfinite

from fwav_companion.tools.report.drawing import (
    LinearAxes,
    circle,
    cross,
    drawing,
    line,
    polyline,
    text,
    thinned,
    ticks,
)
from fwav_companion.tools.report.landing_record import LandingPoint, LandingRecord
from fwav_companion.tools.report.page_elements import figure, key, row, section, table
from fwav_companion.tools.report.wording import length

MOST_POINTS = 600
VIEW = 340.0
"""Width and height of the view from above, in SVG units."""
LEAST_SPAN_M = 0.4
PATH_WORDS = (
    "View from above, north up, metres from the landing point: the vehicle by each LANDING_TARGET. "
    "Grey: the pad was not in the picture."
)
OFFSET_WORDS = (
    "Distance from the landing point and its claimed radius over the height above it: read from right to left."
)


def landing_section(landing: LandingRecord | None) -> str:
    """The section; empty without a landing."""
    if landing is None:
        return ""
    figures = [_path_figure(landing), _offset_figure(landing.points)] if len(landing.points) > 1 else []
    drawn = f'<div class="two">{"".join(figures)}</div>' if figures else ""
    return section("The landing", _words(landing), drawn + _pause_table(landing) + _event_table(landing))


def _words(landing: LandingRecord) -> str:
    messages, last = f"{landing.sent} LANDING_TARGET messages were sent", landing.last_seen
    if last is None:
        return f"{messages}."
    claim = f", with a claimed radius of {length(last.radius95_m)} (95 %)" if isfinite(last.radius95_m) else ""
    return (
        f"{messages}. In the last picture of the pad the vehicle was {length(last.height)} above the landing point and "
        f"{length(last.offset_m)} from it in the horizontal{claim}."
    )


def _path_figure(landing: LandingRecord) -> str:
    points, last = landing.points, landing.last_seen
    span_m = 2.2 * max(LEAST_SPAN_M, *(max(abs(point.north), abs(point.east)) for point in points))
    scale, middle = VIEW / span_m, VIEW / 2.0

    def at(point: LandingPoint) -> tuple[float, float]:
        return middle + scale * point.east, middle - scale * point.north

    parts = []
    for metres in ticks(-0.5 * span_m, 0.5 * span_m, 5):
        here = middle + scale * metres
        parts += [line((here, 0.0), (here, VIEW), "grid"), line((0.0, here), (VIEW, here), "grid")]
        parts.append(text((here + 3.0, VIEW - 4.0), f"{metres:g}", "tick"))
        parts.append(text((3.0, VIEW - here - 3.0), f"{metres:g}", "tick"))
    for seen, stretch in groupby(points, key=lambda point: point.seen):
        parts.append(polyline(thinned(list(map(at, stretch)), MOST_POINTS), "ours" if seen else "path"))
    parts.append(cross((middle, middle), 7.0, "truth"))
    entries = [("ours", "line", "vehicle"), ("truth", "cross", "landing point")]
    if last is not None:
        parts.append(circle(at(last), 4.0, "estimate", "the last picture"))
        entries.append(("estimate", "dot", "last picture"))
    return figure("Path over the pad", drawing(VIEW, VIEW, parts, PATH_WORDS), PATH_WORDS, key=key(entries))


def _offset_figure(points: Sequence[LandingPoint]) -> str:
    seen = [point for point in points if point.seen] or points
    claimed = [point for point in seen if isfinite(point.radius95_m)]
    top_m = max([*(point.offset_m for point in seen), *(point.radius95_m for point in claimed)])
    axes = LinearAxes((0.0, max(1.0, 1.05 * max(point.height for point in seen))), (0.0, 1.1 * top_m), (360.0, 340.0))
    parts = [
        *axes.elements("height, m", "metres"),
        polyline(thinned([axes.at(point.height, point.radius95_m) for point in claimed], MOST_POINTS), "bound"),
        polyline(thinned([axes.at(point.height, point.offset_m) for point in seen], MOST_POINTS), "ours"),
    ]
    entries = key([("ours", "line", "offset"), ("bound", "line", "claimed radius, 95 %")])
    return figure("Offset over height", drawing(*axes.size, parts, OFFSET_WORDS), OFFSET_WORDS, key=entries)


def _pause_table(landing: LandingRecord) -> str:
    """What was withheld, and why."""
    if not landing.pauses:
        return "<p>LANDING_TARGET never paused for half a second.</p>"
    rows = [
        row(
            [
                f"{each.from_s:.1f} s",
                f"{each.to_s - each.from_s:.1f} s",
                _height(landing, each.from_s),
                each.why or "no text",
            ]
        )
        for each in landing.pauses
    ]
    return f'<div class="reasons">{table(["withheld from", "for", "height", "why"], rows)}</div>'


def _event_table(landing: LandingRecord) -> str:
    if not landing.events:
        return ""
    rows = [row([f"{each.at_s:.1f} s", _height(landing, each.at_s), each.by, each.text]) for each in landing.events]
    return f'<div class="reasons">{table(["time", "height", "by", "text or mode"], rows)}</div>'


def _height(landing: LandingRecord, at_s: float) -> str:
    height_m = landing.height_at(at_s)
    return "" if height_m is None else f"{height_m:.1f} m"
