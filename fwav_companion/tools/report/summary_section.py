"""The first screen of the report: places of the targets, their accuracy, and what limits it. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import hypot
from statistics import median

import msgspec

from fwav_companion.tools.reason_table import words_of
from fwav_companion.tools.report.flight_data import FlightData
from fwav_companion.tools.report.target_series import SeriesPoint, TargetSeries
from fwav_companion.tools.report.tracking_variants import PLAIN
from fwav_companion.tools.report.wording import CAUSE_NAMES, length, spaced


class SecondResult(msgspec.Struct, frozen=True):
    """The result of a second flight on the first screen."""

    sentence: str
    card: tuple[str, str] | None = None
    """A figure and its name; None without a result."""


def summary_section(flight: FlightData, second: SecondResult | None = None) -> str:
    """Headline, results in words, and cards with figures."""
    paragraphs = [("lead also", _result(flight))]
    if flight.mistake:
        paragraphs.append(("lead off", f"Do not trust these results: {flight.mistake}."))
    paragraphs.append(("lead", _common_error(flight) or _limit(flight)))
    if second is not None:
        paragraphs.append(("lead", second.sentence))
    words = "".join(f'<p class="{kind}">{escape(each)}</p>' for kind, each in paragraphs if each)
    cards = [*_cards(flight), *([second.card] if second is not None and second.card is not None else [])]
    items = "".join(f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>" for value, name in cards)
    return (
        f'<header><p class="kicker">fwav-companion</p><h1>{escape(flight.title)}</h1>{words}</header>'
        f'<section class="cards">{items}</section>'
    )


def final_estimates(flight: FlightData) -> list[tuple[TargetSeries, SeriesPoint]]:
    """The targets that were found, with their final estimates."""
    return [(target, target.last) for target in flight.targets if target.found and target.last is not None]


def _result(flight: FlightData) -> str:
    ends = final_estimates(flight)
    if not ends:
        return _why_nothing(flight)
    if len(ends) == 1 and len(flight.targets) == 1:
        return _single_result(flight, *ends[0])
    known = len(flight.targets) - flight.ghosts
    found = f"{len(ends)} of {known}" if flight.has_truth else f"{len(ends)}"
    height = "" if flight.height_m is None else f" from {flight.height_m:.0f} m above the ground"
    ghosts = f" {_ghosts(flight)}: no true target belongs to it." if flight.ghosts == 1 else (
        f" {_ghosts(flight)}: no true target belongs to them." if flight.ghosts else "")  # fmt: skip
    verb = "was at the end" if flight.moving else "is"
    radius = length(median(last.radius95_m for _, last in ends))
    return (
        f"{found} targets found{height} in {flight.frames} pictures.{ghosts} Each of them {verb} within about {radius} "
        "of its dot on the map (95 %)."
    )


def _single_result(flight: FlightData, target: TargetSeries, last: SeriesPoint) -> str:
    place = f" at {target.place[0]:.7f}, {target.place[1]:.7f}," if target.place else ""
    origin = "the origin" if flight.origin else "the point below the camera"
    north = f"{abs(last.north):.2f} m {'north' if last.north >= 0 else 'south'}"
    east = f"{abs(last.east):.2f} m {'east' if last.east >= 0 else 'west'}"
    verb = "was last" if flight.moving else "is"
    name = target.name[:1].upper() + target.name[1:]
    return (
        f"{name} {verb}{place} {north} and {east} of {origin}. It is within {length(last.radius95_m)} of that place "
        "(95 %)."
    )


def _ghosts(flight: FlightData) -> str:
    return "1 confirmed track is a ghost" if flight.ghosts == 1 else f"{flight.ghosts} confirmed tracks are ghosts"


def _relative_errors_m(flight: FlightData) -> list[float]:
    """Errors relative to the vehicle of the targets that were found; empty where they are not known."""
    errors = [target.relative_error_m for target, _ in final_estimates(flight)]
    return [error_m for error_m in errors if error_m is not None]


def _common_error(flight: FlightData) -> str:
    """Effect of the vehicle's position error on all targets; empty if it is not the largest error."""
    relative_m = _relative_errors_m(flight)
    if flight.position_error_m is not None and relative_m:
        many = f" (median of {len(relative_m)})" if len(relative_m) > 1 else ""
        return (
            f"Relative to the vehicle the error is {length(median(relative_m))}{many}. On the map the error of the "
            f"vehicle's own GNSS position is added, here {length(hypot(*flight.position_error_m))}: it is one error, "
            "common to all targets, and moves them together."
        )
    if _largest_cause(flight) == "position" and len(final_estimates(flight)) > 1:
        return (
            f"The largest error is the vehicle's own position (GNSS), {length(flight.budget95_m['position'])} (95 %). "
            "It is one error, common to all targets, and moves them together."
        )
    return ""


def _largest_cause(flight: FlightData) -> str:
    return max(flight.budget95_m, key=lambda each: flight.budget95_m[each], default="")


def _why_nothing(flight: FlightData) -> str:
    if not flight.detections:
        return f"No target was found: nothing was detected in {flight.frames} pictures."
    counts = [(count, reason, what) for what, dropped in (
        ("frames", flight.refused_frames), ("detections", flight.refused_detections),
    ) for reason, count in dropped.items()]  # fmt: skip
    if not counts:
        return f"No target was found: {flight.detections} detections were too few, or did not agree."
    count, reason, what = max(counts)
    return f"No target was found. Most frequent reason, {count} {what}: {words_of(reason) or f'{spaced(reason)}.'}"


def _limit(flight: FlightData) -> str:
    if not flight.budget95_m or not final_estimates(flight):
        return ""
    cause = _largest_cause(flight)
    largest = f"{CAUSE_NAMES.get(cause, cause)}, {length(flight.budget95_m[cause])} (95 %)."
    if not _is_calibrated(flight):
        return f"Largest error of one sighting: {largest}"
    plain = [
        other.last.radius95_m
        for target, _ in final_estimates(flight)
        for other in target.variants
        if other.kind == PLAIN.kind and other.last is not None
    ]
    without = f" Without that calibration the claimed radius would be {length(median(plain))} (95 %)." if plain else ""
    return f"Largest error of one sighting, before the camera was calibrated in flight: {largest}{without}"


def _is_calibrated(flight: FlightData) -> bool:
    """Whether the estimates use the result of self-calibration."""
    return bool(flight.calibration) and not flight.calibrated_by and flight.calibration[-1].status != "waiting"


def _cards(flight: FlightData) -> list[tuple[str, str]]:
    """(figure, name) of each card; the errors within their claim only where the common error is not taken apart."""
    ends = final_estimates(flight)
    cards = [_found_card(flight, len(ends))]
    if flight.height_m is not None:
        cards.append((f"{flight.height_m:.0f} m", "height above the ground"))
    relative_m = _relative_errors_m(flight)
    if relative_m:
        cards.append((length(median(relative_m)), f"error relative to the vehicle{_median(relative_m)}"))
    errors_m = [last.error_m for _, last in ends if last.error_m is not None]
    if errors_m:
        name = "error on the map, with GNSS" if relative_m else "true error"
        cards.append((length(median(errors_m)), f"{name}{_median(errors_m)}"))
    if ends:
        cards.append((length(median(last.radius95_m for _, last in ends)), f"claimed radius (95 %){_median(ends)}"))
    if errors_m and not relative_m:
        inside = sum(last.error_m <= last.radius95_m for _, last in ends if last.error_m is not None)
        cards.append((f"{inside} / {len(errors_m)}", "errors within their claim"))
    elif not errors_m and not flight.budget95_m:
        cards.append((f"{flight.fixes}", f"sightings used in {flight.seconds:.0f} s"))
    return cards


def _found_card(flight: FlightData, found: int) -> tuple[str, str]:
    """Found targets of the true ones; ghosts are counted apart."""
    if not flight.has_truth:
        return f"{found}", "target found" if found == 1 else "targets found"
    ghosts = "" if not flight.ghosts else f"; {flight.ghosts} ghost{'s' if flight.ghosts > 1 else ''}"
    return f"{found} / {len(flight.targets) - flight.ghosts}", f"targets found{ghosts}"


def _median(values: Sequence[object]) -> str:
    return ", median" if len(values) > 1 else ""
