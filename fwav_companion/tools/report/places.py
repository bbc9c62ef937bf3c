"""Where everything is: the map, the table, and what the camera saw. Pure."""

from __future__ import annotations

from html import escape

from fwav_companion.tools.report.courses import Course
from fwav_companion.tools.report.map import flight_map
from fwav_companion.tools.report.markup import KeyEntry, figure, key, row, table
from fwav_companion.tools.report.picture import picture
from fwav_companion.tools.report.story import PictureShown, Story
from fwav_companion.tools.report.words import metres, short

FROM_ORIGIN = "From above, north up, metres from the origin."
FROM_VEHICLE = (
    "From above, north up, metres from the point below the camera: the vehicle's own position was not known, so what "
    "stands still on the ground moves here."
)
MAP_WORDS = (
    "Each small dot is one sighting, carried to the ground through the vehicle's attitude at the instant its image row "
    "was exposed. The ellipse counts what the scatter cannot show: errors that are the same in every picture "
    "(position, compass, mount) do not average away, and that of the position moves all answers the same way."
)


def places(story: Story, beside: str = "") -> str:
    """Two sections: the map with the picture, or what is given, beside it; and the table."""
    drawn = flight_map(story)
    if story.picture is not None:
        beside = _picture_figure(story.picture)
    if drawn:
        caption = f"{FROM_ORIGIN if story.origin else FROM_VEHICLE} {MAP_WORDS}"
        drawn = figure("Where everything is", drawn, caption, key=_key(story))
    both = f'<section class="two">{drawn}{beside}</section>' if drawn or beside else ""
    return f"{both}{_table(story)}"


def _key(story: Story) -> str:
    entries: list[KeyEntry] = []
    if story.path:
        way = "the way flown" if story.path_is_true else "where it believed to be when it saw something"
        entries.append(("path", "line", way))
    if any(course.fixes for course in story.courses):
        entries.append(("fix", "dot", "one sighting on the ground"))
    if any(course.last for course in story.courses):
        entries += [("estimate", "dot", "the answer"), ("ellipse", "area", "95 % ellipse")]
    if any(course.true_ned for course in story.courses):
        entries.append(("truth", "cross", "the truth"))
    return key(entries)


def _table(story: Story) -> str:
    if not story.courses:
        return ""
    has_truth = any(course.true_ned for course in story.courses)
    has_place = any(course.place for course in story.courses)
    head = ["target", "north, m", "east, m", "claimed 95 %", *["true error"] * has_truth]
    rows = [_row(course, has_place=has_place, has_truth=has_truth) for course in story.courses]
    return f"<section>{table([*head, *['latitude', 'longitude'] * has_place], rows)}</section>"


def _row(course: Course, *, has_place: bool, has_truth: bool) -> str:
    last, name = course.last, short(course.label)
    if last is None:
        return f'<tr><td>{escape(name)}</td><td colspan="{3 + 2 * has_place + has_truth}">not found</td></tr>'
    cells = [name, f"{last.north:.2f}", f"{last.east:.2f}", metres(last.radius95_m)]
    place = [f"{course.place[0]:.7f}", f"{course.place[1]:.7f}"] if course.place else ["", ""] * has_place
    if last.error_m is None:
        return row([*cells, *[""] * has_truth, *place])
    good = last.error_m <= last.radius95_m
    return row([*cells, metres(last.error_m), *place], "good" if good else "off", len(cells))


def _picture_figure(shown: PictureShown) -> str:
    caption = (
        f"Frame {shown.frame}, {shown.size[0]} × {shown.size[1]} pixels, as the camera delivered it: fisheye, rolling "
        "shutter, motion blur of the flapping, noise. Boxes and crosses are the detector's."
    )
    detail = "".join(
        f"<li><b>{escape(short(str(each.get('label', ''))))}</b> at ({each['u']:.1f}, {each['v']:.1f}) px, "
        f"± {_sigma(each.get('sigma')):.1f} px</li>"
        for each in shown.detections
    )
    return figure("What the camera saw", picture(shown), caption, below=f'<ul class="seen">{detail}</ul>')


def _sigma(sigma: object) -> float:
    if isinstance(sigma, int | float):
        return float(sigma)
    return max((float(each) for each in sigma), default=0.0) if isinstance(sigma, list | tuple) else 0.0
