"""Two replays of one flight side by side: what another filter, setting or calibration would have said. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import hypot
from statistics import median

from fwav_companion.tools.report.charts import error_chart, errors_of
from fwav_companion.tools.report.courses import Course
from fwav_companion.tools.report.errors import reach
from fwav_companion.tools.report.map import flight_map
from fwav_companion.tools.report.markup import figure, key, section, table
from fwav_companion.tools.report.page import document
from fwav_companion.tools.report.story import Story
from fwav_companion.tools.report.words import length, metres, short


def comparison(
    title: str,
    names: tuple[str, str],
    stories: tuple[Story, Story],
    differences: Sequence[str],
    notes: Sequence[str] = (),
) -> str:
    """The whole file. ``stories``: each told with the other as another way; ``differences``: of configurations."""
    changed = "".join(f"<li><code>{escape(each)}</code></li>" for each in differences)
    told = f"<p>What differs in their configurations:</p><ul>{changed}</ul>" if changed else ""
    same = "" if changed else "<p>Their configurations are the same.</p>"
    noted = "".join(f"<p>{escape(note)}</p>" for note in notes)
    head = (
        f'<header><p class="kicker">fwav-companion</p><h1>{escape(title)}</h1>'
        f'<p class="lead">A is {escape(names[0])}, B is {escape(names[1])}.</p>{told}{same}{noted}</header>'
    )
    maps = "".join(
        figure(f"{side}: {name}", flight_map(story, other), _figures(story))
        for side, name, story, other in zip("AB", names, stories, reversed(stories), strict=True)
    )
    return document(title, [head, f'<section class="two">{maps}</section>', _table(stories), _errors(stories)])


def _figures(story: Story) -> str:
    radii = [course.last.radius95_m for course in story.courses if course.found and course.last]
    claim = f"; claimed: 95 % within {length(median(radii))} (median)" if radii else ""
    targets = "1 target" if len(radii) == 1 else f"{len(radii)} targets"
    return f"{targets} from {story.fixes} sightings used of {story.detections}{claim}."


def pairs(stories: tuple[Story, Story]) -> list[tuple[str, Course | None, Course | None]]:
    """(name, in A, in B): a target of both is one row, whatever number its track has in each."""
    ours, theirs = stories
    left = list(theirs.courses)
    found: list[tuple[str, Course | None, Course | None]] = []
    for course in ours.courses:
        same = next((each for each in left if _is_same(course, each)), None)
        if same is not None:
            left.remove(same)
        found.append((course.label, course, same))
    return [*found, *((course.label, None, course) for course in left)]


def _is_same(ours: Course, theirs: Course) -> bool:
    """Where A was told of B's answer, that one; where one of them found nothing, the same truth."""
    answer = ours.others[0].last if ours.others else None
    if answer is not None and theirs.last is not None:
        return (answer.north, answer.east) == (theirs.last.north, theirs.last.east)
    found_in_both = ours.last is not None and theirs.last is not None
    return not found_in_both and ours.true_ned is not None and ours.true_ned == theirs.true_ned


def _table(stories: tuple[Story, Story]) -> str:
    rows = [
        f"<tr><td>{escape(short(name))}</td>{_cells(ours)}{_cells(theirs)}<td>{_apart(ours, theirs)}</td></tr>"
        for name, ours, theirs in pairs(stories)
    ]
    head = [f"{side} {what}" for side in "AB" for what in ("claimed 95 %", "true error")]
    return section("At the end", "", table(["target", *head, "apart"], rows))


def _cells(course: Course | None) -> str:
    last = course.last if course is not None else None
    if last is None:
        return '<td colspan="2">not found</td>'
    error = "" if last.error_m is None else metres(last.error_m)
    return f"<td>{metres(last.radius95_m)}</td><td>{error}</td>"


def _apart(ours: Course | None, theirs: Course | None) -> str:
    if ours is None or theirs is None or ours.last is None or theirs.last is None:
        return ""
    return metres(hypot(ours.last.north - theirs.last.north, ours.last.east - theirs.last.east))


def _errors(stories: tuple[Story, Story]) -> str:
    sides = [
        (f"{side}: {short(name)}", course, stories[0].seconds)
        for name, *both in pairs(stories)
        for side, course in zip("AB", both, strict=True)
        if course is not None and errors_of(course.instants)
    ]
    if not sides:
        return ""
    top_m = reach([course for _, course, _ in sides])
    drawn = "".join(figure(name, error_chart(course, seconds, top_m)) for name, course, seconds in sides)
    entries = [("ours", "line", "error"), ("claim", "area", "claimed, 95 %"), ("fix", "dot", "one sighting alone")]
    heading = "Error over time, against what was claimed"
    return section(heading, "All charts have the same scale.", f'{key(entries)}<div class="grid pairs">{drawn}</div>')
