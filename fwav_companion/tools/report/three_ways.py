"""One recording tracked in several ways: each one's error over time, and what it ended with and claimed. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, hypot, log10

from fwav_companion.tools.report.axes import WIDE, LogFrame
from fwav_companion.tools.report.charts import errors_of, strokes
from fwav_companion.tools.report.courses import Alternative, Course
from fwav_companion.tools.report.markup import figure, key, row, section, table
from fwav_companion.tools.report.story import Story
from fwav_companion.tools.report.svg import Point, drawing
from fwav_companion.tools.report.words import length, metres, short

MOST_TARGETS = 6
"""With a chart each: those that were seen most."""
FINEST_M = 0.001
ALIKE = 1.5
"""Errors of one flight that differ by less tell nothing of their filters."""
ORDER = ("paper", "own", "plain", "calibrated")
"""The simplest first."""


def three_ways(story: Story, title: str = "The same flight, tracked in other ways", words: str = "") -> str:
    """A section; empty where the recording was tracked in one way only."""
    courses = [course for course in story.courses if course.found and any(other.instants for other in course.others)]
    courses = sorted(courses, key=lambda course: -len(course.fixes))[:MOST_TARGETS]
    if not courses:
        return ""
    drawn = [_pair(course, story) for course in courses]
    return section(title, words or _words(courses), "".join(drawn))


def ways_of(course: Course, story: Story) -> list[Alternative]:
    """Ours among the others."""
    ours = Alternative(story.way.name, story.way.kind, course.instants)
    return sorted([ours, *course.others], key=lambda way: ORDER.index(way.kind))


def _words(courses: Sequence[Course]) -> str:
    said = "Every filter was given the same pictures and telemetry."
    if any(errors_of(course.instants) for course in courses):
        return (
            f"{said} Solid: how far each answer was from the truth, on a logarithmic scale. Dashed: the distance that "
            "it claimed to stay within in 95 of 100 cases."
        )
    return f"{said} Without a known truth their answers can be compared with one another, and so can their claims."


def _pair(course: Course, story: Story) -> str:
    """A chart and a table side by side."""
    ways, name = ways_of(course, story), short(course.label)
    entries = [(way.kind, "line", way.name) for way in ways if way.instants]
    if any(errors_of(way.instants) for way in ways):
        title = f"How far from the truth: {name}"
        entries.append(("claimed", "line", "what each claimed, 95 %"))
    else:
        title = f"What each claimed, 95 %: {name}"
    drawn = figure(title, chart_of(ways, story.seconds, name), key=key(entries))
    at_the_end = figure("At the end", _table(course, ways, story), _conclusion(ways))
    return f'<div class="two broad">{drawn}{at_the_end}</div>'


def chart_of(ways: Sequence[Alternative], seconds: float, name: str) -> str:
    """Errors as lines, claims dashed, over decades of metres; the claims alone where there is no truth."""
    errors = [error_m for way in ways for _, error_m in errors_of(way.instants)]
    claims = [one.radius95_m for way in ways for one in way.instants]
    frame = LogFrame((0.0, max(seconds, 1.0)), _decades(errors or claims, claims), WIDE)
    parts = frame.axes("seconds", "distance from the truth" if errors else "radius of the circle")
    for way in ways:
        parts += strokes(frame, _claimed(way), f"{'claimed' if errors else 'way'} way-{way.kind}")
    for way in ways:
        parts += strokes(frame, errors_of(way.instants), f"way way-{way.kind}")
    return drawing(*frame.size, parts, f"{'Error' if errors else 'Claim'} of {name} over time, by filter")


def _claimed(way: Alternative) -> list[Point]:
    return [(one.at_s, one.radius95_m) for one in way.instants]


def _decades(lines: Sequence[float], claims: Sequence[float]) -> Point:
    """From below nearly all of the lines to above everything: one that crosses the truth dips without an end."""
    ranked = sorted(lines)
    low = max(FINEST_M, ranked[len(ranked) // 50] if ranked else FINEST_M)
    low = 10.0 ** floor(log10(low))
    return low, max(1.3 * max([*lines, *claims], default=1.0), 10.0 * low)


def _table(course: Course, ways: Sequence[Alternative], story: Story) -> str:
    has_truth = course.true_ned is not None
    head = ["", "claimed 95 %", "true error" if has_truth else "apart from ours"]
    return table(head, [_row(way, course, story, has_truth=has_truth) for way in ways])


def _row(way: Alternative, course: Course, story: Story, *, has_truth: bool) -> str:
    last, ours = way.last, course.last
    if last is None or ours is None:
        return row([way.name, "not found", ""])
    if has_truth and last.error_m is not None:
        kind = "good" if last.error_m <= last.radius95_m else "off"
        return row([way.name, metres(last.radius95_m), metres(last.error_m)], kind)
    if way.name == story.way.name:
        return row([f"{way.name} (ours)", metres(last.radius95_m), "–"])
    return row([way.name, metres(last.radius95_m), metres(hypot(last.north - ours.north, last.east - ours.east))])


def _conclusion(ways: Sequence[Alternative]) -> str:
    """The best beside the worst, in words."""
    ends = [(way.last.error_m, way) for way in ways if way.last is not None and way.last.error_m is not None]
    if len(ends) < 2:
        return ""
    (best_m, best), (worst_m, worst) = (pick(ends, key=lambda end: end[0]) for pick in (min, max))
    if worst_m < ALIKE * best_m:
        return "At the end they hardly differ: what limits them is common to all."
    return f"At the end {best.name} is {length(best_m)} from the truth, {worst.name} {length(worst_m)}."
