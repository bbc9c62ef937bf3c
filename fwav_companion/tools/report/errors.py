"""Error over time against what was claimed, target by target. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from fwav_companion.tools.report.charts import error_chart, errors_of
from fwav_companion.tools.report.courses import Course
from fwav_companion.tools.report.markup import figure, key, section
from fwav_companion.tools.report.story import Story
from fwav_companion.tools.report.words import short

MOST_TARGETS = 12
"""With a chart each: those that were seen most."""
NEARLY_ALL = 0.97
"""Of the values that a chart's scale has room for: a first claim may be a hundred times the others."""


def errors_section(story: Story) -> str:
    """Empty without a truth."""
    courses = [course for course in story.courses if errors_of(course.instants)]
    if not courses:
        return ""
    shown = [
        course for course in courses if course in sorted(courses, key=lambda each: -len(each.fixes))[:MOST_TARGETS]
    ]
    top_m = reach(shown)
    drawn = "".join(figure(short(course.label), error_chart(course, story.seconds, top_m)) for course in shown)
    entries = [
        ("ours", "line", "error of the answer"),
        ("claim", "area", "what was claimed: 95 % lie below its edge"),
        ("fix", "dot", "error of one sighting alone"),
    ]
    words = (
        "An honest claim holds the line below its edge, nearly always, and is not much wider than it needs to be. "
        "Where a line pauses the target was out of view. All charts have the same scale."
    )
    left_out = len(courses) - len(shown)
    told = f"<p>{left_out} more targets, which were seen less, are in the table alone.</p>" if left_out else ""
    heading = "Error over time, against what was claimed"
    return section(heading, words, f'{key(entries)}<div class="grid">{drawn}</div>{told}')


def reach(courses: Sequence[Course]) -> float:
    """Metres: the top of a scale for all of them. What is beyond stays at the top."""
    claims = sorted(one.radius95_m for course in courses for one in course.instants)
    errors = sorted(error_m for course in courses for _, error_m in errors_of(course.instants))
    tops = [values[int(NEARLY_ALL * (len(values) - 1))] for values in (claims, errors) if values]
    return max(0.01, 1.15 * max(tops, default=1.0))
