"""The first screen: where the target is, how sure that is, and what limited it. Pure."""

from __future__ import annotations

from html import escape
from statistics import median

from fwav_companion.tools.report.courses import Course, Instant
from fwav_companion.tools.report.story import Story
from fwav_companion.tools.report.ways import PLAIN
from fwav_companion.tools.report.words import CAUSE_NAMES, REASONS, SHORT_CAUSES, length, short, words


def answer(story: Story, also: str = "") -> str:
    """A headline, the answer in two sentences, what else there is to see, and its figures."""
    said = " ".join(part for part in (_where(story), _limit(story)) if part)
    wrong = ""
    if story.mistake:
        wrong = f'<p class="lead off">Believe none of it: {escape(story.mistake)}.</p>'
    more = f'<p class="lead also">{escape(also)}</p>' if also else ""
    return (
        f'<header><p class="kicker">fwav-companion</p><h1>{escape(story.title)}</h1>'
        f'<p class="lead">{escape(said)}</p>{wrong}{more}</header>{_cards(story)}'
    )


def ends_of(story: Story) -> list[tuple[Course, Instant]]:
    """The targets that were found, and where each ended."""
    return [(course, course.last) for course in story.courses if course.found and course.last is not None]


def _where(story: Story) -> str:
    ends = ends_of(story)
    if not ends:
        return _nothing(story)
    radius = length(median(last.radius95_m for _, last in ends))
    if len(ends) > 1 or len(story.courses) > 1:
        many = f"{len(ends)} of {len(story.courses)} targets were" if len(story.courses) > len(ends) else (
            f"{len(ends)} targets were")  # fmt: skip
        verb = "was at the end" if story.moving else "stands"
        return (
            f"{many} placed on the ground from {story.frames} pictures. Each really {verb} within about {radius} of "
            "its dot on the map, in 95 of 100 cases."
        )
    course, last = ends[0]
    place = f" at {course.place[0]:.7f}, {course.place[1]:.7f}" if course.place else ""
    origin = "the origin" if story.origin else "the point below the camera"
    side = f"{abs(last.north):.2f} m {'north' if last.north >= 0 else 'south'}"
    across = f"{abs(last.east):.2f} m {'east' if last.east >= 0 else 'west'}"
    verb = "was last" if story.moving else "stands"
    return (
        f"{short(course.label).capitalize()} {verb}{place}, {side} and {across} of {origin}, and with 95 % within "
        f"{radius} of that."
    )


def _nothing(story: Story) -> str:
    """Why there is no answer."""
    if not story.detections:
        return f"No target was found: nothing was detected in {story.frames} pictures."
    if not story.dropped:
        return f"No target was found: {story.detections} detections were too few, or did not agree."
    reason, count = max(story.dropped.items(), key=lambda item: item[1])
    why = REASONS.get(reason, words(reason))
    return f"No target was found. Most was lost {count} times to this: {why[0].lower()}{why[1:].rstrip('.')}."


def _limit(story: Story) -> str:
    if not story.budget_m or not ends_of(story):
        return ""
    cause, sigma_m = max(story.budget_m.items(), key=lambda item: item[1])
    told = f"{CAUSE_NAMES.get(cause, cause)}, {length(sigma_m)} (one sigma)."
    if not _calibrated(story):
        return f"What limited a sighting most: {told}"
    plain = [
        other.last.radius95_m
        for course, _ in ends_of(story)
        for other in course.others
        if other.kind == PLAIN.kind and other.last is not None
    ]
    without = f" Without that calibration the answer would claim {length(median(plain))}." if plain else ""
    return f"What limited a sighting most before the camera was calibrated in flight: {told}{without}"


def _calibrated(story: Story) -> bool:
    """Whether the answers themselves stand on what was learned."""
    return bool(story.learned) and not story.learned_by and story.learned[-1].status != "waiting"


def _cards(story: Story) -> str:
    ends = ends_of(story)
    cards = [(f"{len(ends)} / {len(story.courses)}", "targets found")]
    if ends:
        cards.append((length(median(last.radius95_m for _, last in ends)), "claimed: 95 % lie within"))
    known = [(last.error_m, last.radius95_m) for _, last in ends if last.error_m is not None]
    if known:
        cards.append((length(median(error_m for error_m, _ in known)), "true error" + ", median" * (len(known) > 1)))
        inside = sum(error_m <= radius_m for error_m, radius_m in known)
        cards.append((f"{inside} / {len(known)}", "inside their claim"))
    if story.budget_m:
        cause = max(story.budget_m, key=lambda each: story.budget_m[each])
        cards.append((SHORT_CAUSES.get(cause, cause), "limits a sighting most"))
    else:
        cards.append((f"{story.fixes}", f"sightings used in {story.seconds:.0f} s"))
    told = "".join(f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>" for value, name in cards)
    return f'<section class="cards">{told}</section>'
