"""The page: what was found, where, how surely, and why. Self-contained; light or dark; for a phone too. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from statistics import median

from fwav_companion.report import charts
from fwav_companion.report.story import Course, Story
from fwav_companion.report.style import STYLE

CAUSE_NAMES = {
    "position": "the vehicle's own position (GNSS)",
    "heading": "its heading (compass)",
    "attitude": "its roll and pitch",
    "mount": "how the camera is mounted",
    "height": "its height above the ground",
    "time": "when the picture was taken",
    "pixel": "where in the picture",
    "terrain": "the ground's own shape",
}
REASONS = {
    "no_clock": "The autopilot's clock could not be placed on this board's yet: the first seconds after it is heard.",
    "no_attitude": "No attitude of the vehicle near the picture's instant.",
    "attitude_gap": "A hole in the stream of attitudes, too wide to bridge.",
    "stale_attitude": "The newest attitude was too old.",
    "no_position": "No position of the vehicle near the picture's instant.",
    "outside_lens": "Beyond the range in which the lens is calibrated.",
    "above_horizon": "The line of sight does not meet the ground.",
    "too_shallow": "The line of sight is so flat that small errors move the point far.",
    "too_low": "The vehicle was below the least height.",
    "no_height": "The height above ground was not known.",
    "too_late": "It arrived longer than half a second after its capture.",
    "from_the_future": "Stamped after it arrived.",
    "duplicate_frame": "The same frame came twice.",
    "low_score": "The detector was not sure enough.",
    "other_label": "A label that was not asked for.",
}


def page(story: Story, more: Iterable[str] = ()) -> str:
    """The whole file. ``more``: sections for who wants to look behind it."""
    sections = [
        _head(story),
        _figures(story),
        _map_and_picture(story),
        _errors(story),
        _causes(story),
        _timing(story),
        *more,
        _dropped(story),
        _foot(story),
    ]
    return document(story.title, sections)


def document(title: str, sections: Iterable[str]) -> str:
    """A page of these sections; empty ones are left out."""
    body = "\n".join(section for section in sections if section)
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title><style>{STYLE}</style></head>
<body><main>
{body}
</main></body></html>
"""


def _head(story: Story) -> str:
    found = sum(course.found for course in story.courses)
    targets = f"{found} of {len(story.courses)} targets" if len(story.courses) != found else f"All {found} targets"
    said = (
        f"{targets} placed on the ground from {story.frames} pictures of a camera that shakes with every wing beat. "
        "Every answer carries its own uncertainty: the circle that holds the target in 95 of 100 cases."
    )
    return (
        f'<header><p class="kicker">fwav-companion</p><h1>{escape(story.title)}</h1><p class="lead">{said}</p></header>'
    )


def _figures(story: Story) -> str:
    ends = [(course.last, course) for course in story.courses if course.found and course.last]
    errors = [last.error_m for last, _ in ends if last.error_m is not None]
    radii = [last.radius95_m for last, _ in ends]
    cards = [(f"{sum(c.found for c in story.courses)} / {len(story.courses)}", "targets found")]
    if radii:
        cards.append((f"{median(radii):.2f} m", "claimed: 95 % lie within"))
    if errors:
        inside = sum(last.error_m <= last.radius95_m for last, _ in ends if last.error_m is not None)
        cards.append((f"{median(errors):.2f} m", "true error, median"))
        cards.append((f"{inside} / {len(errors)}", "inside their claim"))
    cards.append((f"{story.fixes}", f"fixes in {story.seconds:.0f} s"))
    told = "".join(f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>" for value, name in cards)
    return f'<section class="cards">{told}</section>'


def _map_and_picture(story: Story) -> str:
    way = "The way flown" if story.path_is_true else "Where the vehicle believed to be"
    key = _key(
        [("path", "line", way), ("fix", "dot", "one detection on the ground"), ("estimate", "dot", "the answer"),
         ("ellipse", "area", "95 % ellipse"), *([("truth", "cross", "the truth")] if _has_truth(story) else [])]
    )  # fmt: skip
    map_caption = (
        "From above, north up, metres from the origin. Each small dot is one sighting, carried to the ground through "
        "the vehicle's attitude at the instant its image row was exposed. The ellipse is wider than their scatter: "
        "errors that are the same in every picture (position, compass, mount) do not average away."
    )
    map_figure = _figure("Where everything is", charts.flight_map(story), map_caption, key=key)
    if story.picture is None:
        return f'<section class="one">{map_figure}</section>'
    shown = story.picture
    caption = (
        f"Frame {shown.frame}, {shown.size[0]} × {shown.size[1]} pixels, as the camera delivered it: fisheye, rolling "
        "shutter, motion blur of the flapping, noise. Boxes and crosses are the detector's."
    )
    detail = "".join(
        f"<li><b>{escape(charts.short(str(each.get('label', ''))))}</b> at ({each['u']:.1f}, {each['v']:.1f}) px, "
        f"± {_sigma(each.get('sigma')):.1f} px</li>"
        for each in shown.detections
    )
    below = f'<ul class="seen">{detail}</ul>'
    picture_figure = _figure("What the camera saw", charts.picture(shown), caption, below=below)
    table = _table(story)
    return f'<section class="two">{map_figure}<div>{picture_figure}{table}</div></section>'


def _sigma(sigma: object) -> float:
    if isinstance(sigma, int | float):
        return float(sigma)
    return max((float(each) for each in sigma), default=0.0) if isinstance(sigma, list | tuple) else 0.0


def _table(story: Story) -> str:
    rows = "".join(_row(course) for course in story.courses)
    head = "<tr><th>target</th><th>north</th><th>east</th><th>claimed 95 %</th><th>true error</th></tr>"
    return f'<div class="scroll"><table>{head}{rows}</table></div>'


def _row(course: Course) -> str:
    name = escape(charts.short(course.label))
    last = course.last
    if last is None:
        return f'<tr><td>{name}</td><td colspan="4">not found</td></tr>'
    error = "" if last.error_m is None else f"{last.error_m:.2f} m"
    good = last.error_m is None or last.error_m <= last.radius95_m
    kind = "good" if good else "off"
    return (
        f"<tr><td>{name}</td><td>{last.north:.2f}</td><td>{last.east:.2f}</td>"
        f'<td>{last.radius95_m:.2f} m</td><td class="{kind}">{error}</td></tr>'
    )


def _errors(story: Story) -> str:
    courses = [course for course in story.courses if course.instants]
    if not courses or not _has_truth(story):
        return ""
    tops = [instant.radius95_m for course in courses for instant in course.instants]
    tops += [one.error_m for course in courses for one in course.instants if one.error_m is not None]
    top_m = 1.1 * max(tops)
    drawn = "".join(
        _figure(charts.short(course.label), charts.error_chart(course, story.seconds, top_m)) for course in courses
    )
    others = any(course.other for course in courses)
    theirs = [("other", "line", f"error of {story.other_name}")] if others else []
    claim = ("claim", "area", "what was claimed: 95 % lie below its edge")
    key = _key([("ours", "line", "error of our answer"), *theirs, claim, ("fix", "dot", "error of one sighting alone")])
    words = (
        "An honest claim holds the line below its edge, nearly always, and is not much wider than it needs to be. "
        "Where a line pauses the target was out of view."
    )
    if others:
        words += (
            f" Beside it {escape(story.other_name)}: the same sightings through a first-order low-pass, which says "
            "nothing of its own error."
        )
    heading = "<h2>Error over time, against what was claimed</h2>"
    return f'<section>{heading}<p>{words}</p>{key}<div class="grid">{drawn}</div></section>'


def _causes(story: Story) -> str:
    bars = charts.budget_bars(story.budget_m, CAUSE_NAMES)
    hidden = "".join(
        f"<tr><td>{escape(name)}</td><td>{escape(value)}</td></tr>" for name, value in story.hidden.items()
    )
    parts = []
    if bars:
        words = "One sigma on the ground, by its cause. The longest bar is what to improve first."
        parts.append(f"<div><h3>What one sighting can be off by</h3><p>{words}</p>{bars}</div>")
    if hidden:
        words = "Drawn from the configuration's own priors. The service was told none of it."
        parts.append(f"<div><h3>What was wrong with this vehicle</h3><p>{words}</p><table>{hidden}</table></div>")
    return f'<section><h2>Why not better?</h2><div class="two">{"".join(parts)}</div></section>' if parts else ""


def _timing(story: Story) -> str:
    clock = charts.clock_chart(story.clock, story.seconds) if len(story.clock) > 1 else ""
    gaps = charts.gaps_chart(story.gaps_s)
    if not clock and not gaps:
        return ""
    figures = []
    if clock:
        last = story.clock[-1]
        caption = (
            f"Pictures are stamped by this board, attitudes by the autopilot. At the end the two clocks were known to "
            f"{last.sigma_s * 1e3:.2f} ms (one sigma), and beyond doubt to {last.bound_s * 1e3:.2f} ms."
        )
        key = _key([("ours", "line", "one sigma"), ("bound", "line", "hard bound")])
        figures.append(_figure("The two clocks", clock, caption, key=key))
    if gaps:
        caption = (
            "Each sighting takes the attitude of the instant its image row was exposed, interpolated between messages. "
            f"Half of them lie within {median(story.gaps_s) * 1e3:.1f} ms of one. At 5 wing beats a second 10 ms can "
            "be two degrees."
        )
        figures.append(_figure("How near the next attitude was", gaps, caption))
    return f'<section><h2>Every sighting in its own instant</h2><div class="two">{"".join(figures)}</div></section>'


def _dropped(story: Story) -> str:
    total = f"{story.frames} frames were looked at, {story.detections} detections made, {story.fixes} used."
    if not story.dropped:
        return f"<section><h2>What was not used</h2><p>{total} Nothing was dropped.</p></section>"
    rows = "".join(
        f"<tr><td>{escape(_words(reason))}</td><td>{count}</td><td>{escape(REASONS.get(reason, ''))}</td></tr>"
        for reason, count in sorted(story.dropped.items(), key=lambda item: -item[1])
    )
    return (
        f"<section><h2>What was not used, and why</h2><p>{total} What cannot answer says so, by name.</p>"
        f'<div class="scroll"><table class="reasons">{rows}</table></div></section>'
    )


def _foot(story: Story) -> str:
    origin = story.origin
    where = f"Origin {origin.lat_deg:.7f}, {origin.lon_deg:.7f}, {origin.alt_amsl_m:.1f} m AMSL. " if origin else ""
    notes = "".join(f"<p>{escape(note)}</p>" for note in story.notes)
    return f"<footer>{notes}<p>{where}fwav-companion {escape(story.version)}.</p></footer>"


def _words(reason: str) -> str:
    return reason.replace("_", " ")


def _figure(title: str, drawn: str, caption: str = "", *, key: str = "", below: str = "") -> str:
    told = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return f"<figure><h3>{escape(title)}</h3>{key}{drawn}{told}{below}</figure>"


def _key(entries: Iterable[tuple[str, str, str]]) -> str:
    told = "".join(f'<li><i class="k-{form} k-{kind}"></i>{escape(name)}</li>' for kind, form, name in entries)
    return f'<ul class="key">{told}</ul>'


def _has_truth(story: Story) -> bool:
    return any(course.true_ned for course in story.courses)
