"""The page about the result of a click, in figures, pictures and over time. PURE."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from typing import Final

from fwav_companion import __version__
from fwav_companion.tools.click_flight.click_score import ClickScore
from fwav_companion.tools.report.drawing import WIDE_CHART, LinearAxes, circle, drawing
from fwav_companion.tools.report.page_elements import document, figure, key, section
from fwav_companion.tools.report.wording import length

TITLE: Final = "A click, followed from a flapping wing"
NOTE: Final = (
    "The autopilot was a mock, its pictures were rendered, and the flight took place in simulated time. The pipeline "
    "and the spot tracker are those that fly on a vehicle."
)
LEAST_AXIS_PX: Final = 3.0
MARGIN: Final = 1.1


def click_page(score: ClickScore, pictures: Sequence[tuple[str, bytes]], *, command: str) -> str:
    """The HTML file. ``pictures``: (caption, JPEG); ``command`` repeats the flight."""
    sections = [_summary(score), _picture_section(pictures), _error_section(score), _foot(command)]
    return document(TITLE, sections)


def _summary(score: ClickScore) -> str:
    verdict = "".join(f"<p>{escape(trouble[0].upper() + trouble[1:])}.</p>" for trouble in score.troubles)
    lead = (
        "A ground station clicked on a random place in a picture of the camera. The service took the picture that was "
        "on the screen then, predicted by attitude and position where each later picture must show the spot, and "
        "looked there."
    )
    cards = [
        (f"{score.sharp_found} of {score.sharp}", "frames with the sharp spot in which it was found"),
        (str(score.passes), "times that the spot was in the picture"),
    ]
    if score.added95_m is not None:
        cards.append((length(score.added95_m), "added by the tracker, 95 % of the frames"))
    if score.error_m is not None and score.claimed95_m is not None:
        cards.append((length(score.error_m), f"error on the map; claimed {length(score.claimed95_m)} (95 %)"))
    boxes = "".join(f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>" for value, name in cards)
    head = f'<p class="kicker">fwav-companion</p><h1>{escape(TITLE)}</h1><p class="lead">{escape(lead)}</p>{verdict}'
    return f'<header>{head}</header><div class="cards">{boxes}</div>'


def _picture_section(pictures: Sequence[tuple[str, bytes]]) -> str:
    figures = "".join(
        f'<figure><img style="width:100%" alt="{escape(caption)}" src="data:image/jpeg;base64,'
        f'{b64encode(jpeg).decode()}"><figcaption>{escape(caption)}</figcaption></figure>'
        for caption, jpeg in pictures
    )
    return section("Pictures", "", f'<div class="grid">{figures}</div>') if figures else ""


def _error_section(score: ClickScore) -> str:
    """Distance of each detection from the true spot, and the frames in which it was in view and not found."""
    if not score.samples:
        return ""
    errors = [(each.at_s, each.error_px) for each in score.samples if each.error_px is not None]
    missed = [each.at_s for each in score.samples if each.error_px is None]
    top = MARGIN * max([LEAST_AXIS_PX, *(error_px for _, error_px in errors)])
    times = [each.at_s for each in score.samples]
    axes = LinearAxes((times[0], max(times[-1], times[0] + 1.0)), (0.0, top), WIDE_CHART)
    parts = axes.elements("seconds of the flight", "pixels")
    parts += [circle(axes.at(at_s, error_px), 3.0, "estimate") for at_s, error_px in errors]
    parts += [circle(axes.at(at_s, 0.0), 3.0, "fix") for at_s in missed]
    legend = key([("estimate", "dot", "found: distance from the true spot"), ("fix", "dot", "in view, not found")])
    drawn = drawing(*axes.size, parts, "Error of the spot over time")
    caption = "Between two passes the spot is outside the picture. Frames that the flapping blurs are not found."
    shown = figure("Distance from the true spot", drawn, caption, key=legend)
    return section("Error over time", "", f'<div class="two">{shown}</div>')


def _foot(command: str) -> str:
    """The kind of flight, and the command that repeats it."""
    version = f"fwav-companion {__version__}."
    return f"<footer><p>{escape(NOTE)}</p><p>Repeat it: {escape(command)}</p><p>{version}</p></footer>"
