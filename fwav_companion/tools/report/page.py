"""The page: what was found, where, how surely, and why. Self-contained; light or dark; for a phone too. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from statistics import median

import msgspec

from fwav_companion.tools.report.answer import answer
from fwav_companion.tools.report.causes import budget, causes, not_used
from fwav_companion.tools.report.charts import clock_chart, gaps_chart
from fwav_companion.tools.report.errors import errors_section
from fwav_companion.tools.report.learning import learning
from fwav_companion.tools.report.markup import figure, key, section
from fwav_companion.tools.report.places import places
from fwav_companion.tools.report.story import Story
from fwav_companion.tools.report.style import STYLE
from fwav_companion.tools.report.three_ways import three_ways


class Chapter(msgspec.Struct, frozen=True):
    """Another flight, in the same report."""

    sections: list[str]
    said: str
    """All of it in a sentence."""


def page(story: Story, more: Iterable[str] = (), chapter: Chapter | None = None) -> str:
    """The whole file. ``more``: for who wants to look behind this flight."""
    # On the first screen, where there is room for it.
    limits = budget(story, "Why not better?") if story.picture is None else ""
    sections = [
        answer(story, chapter.said if chapter else ""),
        places(story, limits),
        f'<div class="chapter">{"".join(chapter.sections)}</div>' if chapter else "",
        three_ways(story),
        learning(story),
        errors_section(story),
        "" if limits else causes(story),
        _timing(story),
        *more,
        not_used(story),
        _foot(story),
    ]
    return document(story.title, sections)


def document(title: str, sections: Iterable[str]) -> str:
    """A page of these sections; empty ones are left out."""
    body = "\n".join(each for each in sections if each)
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title><style>{STYLE}</style></head>
<body><main>
{body}
</main></body></html>
"""


def _timing(story: Story) -> str:
    clock = clock_chart(story.clock, story.seconds) if len(story.clock) > 1 else ""
    gaps = gaps_chart(story.gaps_s)
    if not clock and not gaps:
        return ""
    figures = []
    if clock:
        last = story.clock[-1]
        caption = (
            f"Pictures are stamped by this board, attitudes by the autopilot. At the end the two clocks were known to "
            f"{last.sigma_s * 1e3:.2g} ms (one sigma), and beyond doubt to {last.bound_s * 1e3:.2g} ms."
        )
        told = key([("ours", "line", "one sigma"), ("bound", "line", "hard bound")])
        figures.append(figure("The two clocks", clock, caption, key=told))
    if gaps:
        caption = (
            "Each sighting takes the attitude of the instant its image row was exposed, interpolated between messages. "
            f"Half of them lie within {median(story.gaps_s) * 1e3:.1f} ms of one. At 5 wing beats a second 10 ms can "
            "be two degrees."
        )
        figures.append(figure("How near the next attitude was", gaps, caption))
    return section("Every sighting in its own instant", "", f'<div class="two">{"".join(figures)}</div>')


def _foot(story: Story) -> str:
    origin = story.origin
    where = f"Origin {origin.lat_deg:.7f}, {origin.lon_deg:.7f}, {origin.alt_amsl_m:.1f} m AMSL. " if origin else ""
    notes = "".join(f"<p>{escape(note)}</p>" for note in story.notes)
    return f"<footer>{notes}<p>{where}fwav-companion {escape(story.version)}.</p></footer>"
