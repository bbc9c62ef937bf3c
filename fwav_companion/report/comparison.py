"""Two replays of one flight side by side: what another filter, setting or calibration would have said. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import hypot
from statistics import median

from fwav_companion.report import charts
from fwav_companion.report.page import document
from fwav_companion.report.story import Course, Story


def comparison(title: str, names: tuple[str, str], stories: tuple[Story, Story], differences: Sequence[str]) -> str:
    """The whole file. ``differences``: of the two configurations, as lines of text."""
    changed = "".join(f"<li><code>{escape(each)}</code></li>" for each in differences)
    told = f"<p>What differs in their configurations:</p><ul>{changed}</ul>" if changed else ""
    same = "" if changed else "<p>Their configurations are the same.</p>"
    head = (
        f'<header><p class="kicker">fwav-companion</p><h1>{escape(title)}</h1>'
        f'<p class="lead">A is {escape(names[0])}, B is {escape(names[1])}.</p>{told}{same}</header>'
    )
    maps = "".join(
        f"<figure><h3>{side}: {escape(name)}</h3>{charts.flight_map(story)}<figcaption>{escape(_figures(story))}"
        "</figcaption></figure>"
        for side, name, story in zip("AB", names, stories, strict=True)
    )
    return document(title, [head, f'<section class="two">{maps}</section>', _table(stories), _errors(stories)])


def _figures(story: Story) -> str:
    radii = [course.last.radius95_m for course in story.courses if course.found and course.last]
    claim = f"; claimed: 95 % within {median(radii):.2f} m (median)" if radii else ""
    return f"{len(radii)} targets from {story.fixes} fixes of {story.detections} detections{claim}."


def _table(stories: tuple[Story, Story]) -> str:
    ours, theirs = ({course.label: course for course in story.courses} for story in stories)
    rows = "".join(
        f"<tr><td>{escape(charts.short(label) or 'target')}</td>{_cells(ours.get(label))}{_cells(theirs.get(label))}"
        f"<td>{_apart(ours.get(label), theirs.get(label))}</td></tr>"
        for label in sorted({*ours, *theirs})
    )
    head = "".join(f"<th>{side} claimed 95 %</th><th>{side} true error</th>" for side in "AB")
    table = f'<div class="scroll"><table><tr><th>target</th>{head}<th>apart</th></tr>{rows}</table></div>'
    return f"<section><h2>At the end</h2>{table}</section>"


def _cells(course: Course | None) -> str:
    last = course.last if course is not None else None
    if last is None:
        return '<td colspan="2">not found</td>'
    error = "" if last.error_m is None else f"{last.error_m:.2f} m"
    return f"<td>{last.radius95_m:.2f} m</td><td>{error}</td>"


def _apart(ours: Course | None, theirs: Course | None) -> str:
    if ours is None or theirs is None or ours.last is None or theirs.last is None:
        return ""
    return f"{hypot(ours.last.north - theirs.last.north, ours.last.east - theirs.last.east):.2f} m"


def _errors(stories: tuple[Story, Story]) -> str:
    instants = [each for story in stories for course in story.courses for each in course.instants]
    errors = [each.error_m for each in instants if each.error_m is not None]
    if not errors:
        return ""
    top_m = 1.1 * max(*errors, *(each.radius95_m for each in instants))
    drawn = "".join(
        f"<figure><h3>{side}: {escape(charts.short(course.label) or 'target')}</h3>"
        f"{charts.error_chart(course, story.seconds, top_m)}</figure>"
        for side, story in zip("AB", stories, strict=True)
        for course in story.courses
        if course.instants
    )
    return f'<section><h2>Error over time, against what was claimed</h2><div class="grid">{drawn}</div></section>'
