"""The page ``compare.html``: two replays side by side, headed by what differs between them. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import hypot
from statistics import median

import msgspec

from fwav_companion.tools.report.error_section import error_chart, errors_of, scale_top_m
from fwav_companion.tools.report.flight_data import FlightData
from fwav_companion.tools.report.map_drawing import flight_map
from fwav_companion.tools.report.page_elements import document, figure, key, section, table
from fwav_companion.tools.report.target_series import SeriesPoint, TargetSeries
from fwav_companion.tools.report.wording import length, table_length

MOST_KEYS_NAMED = 3
"""Most configuration keys that the headline names."""
EQUAL_M = 5e-5
"""Distance below which two estimates are called equal, metres."""
LONGEST_VALUE = 24
"""Most characters of a value in a headline and in column heads."""

Pair = tuple[FlightData, FlightData]


class ConfigDifference(msgspec.Struct, frozen=True):
    """One configuration key with different values; a value is text."""

    key: str
    first: str
    second: str


def comparison(
    names: tuple[str, str], flights: Pair, differences: Sequence[ConfigDifference], notes: Sequence[str] = ()
) -> str:
    """The HTML file; each flight must have the other one as its only variant."""
    sides = _sides(differences)
    sections = [
        _header(names, flights, differences, notes),
        _maps(sides, names, flights),
        _table(sides, flights),
        _error_charts(sides, flights),
    ]
    return document(_headline(flights, differences), sections)


def _header(
    names: tuple[str, str], flights: Pair, differences: Sequence[ConfigDifference], notes: Sequence[str]
) -> str:
    rows = "".join(
        f"<li><code>{escape(each.key)}: {escape(each.first)} | {escape(each.second)}</code></li>"
        for each in differences
    )
    changed = f"<p>Different configuration keys, A | B:</p><ul>{rows}</ul>" if rows else ""
    same = "" if rows else "<p>Their configurations are the same.</p>"
    noted = "".join(f"<p>{escape(note)}</p>" for note in notes)
    lead = " ".join([f"A is {names[0]}, B is {names[1]}.", *_effects(flights)])
    return (
        f'<header><p class="kicker">fwav-companion</p><h1>{escape(_headline(flights, differences))}</h1>'
        f'<p class="lead">{escape(lead)}</p>{changed}{same}{noted}</header>'
    )


def _headline(flights: Pair, differences: Sequence[ConfigDifference]) -> str:
    """The difference of the two replays: in the configuration, else the version, else the recording, else none."""
    first, second = flights
    if len(differences) == 1:
        (only,) = differences
        return f"{only.key}: {_short_value(only.first)} compared with {_short_value(only.second)}"
    if differences:
        named = ", ".join(each.key for each in differences[:MOST_KEYS_NAMED])
        more = len(differences) - MOST_KEYS_NAMED
        return f"{len(differences)} settings differ: {named}{f' and {more} more' if more > 0 else ''}"
    if first.version != second.version:
        return f"Version {first.version} compared with version {second.version}"
    if (first.frames, first.detections, first.start_unix) != (second.frames, second.detections, second.start_unix):
        return "Two recordings with the same configuration"
    apart_m = [each for each in map(_apart_m, *_columns(flights)) if each is not None]
    return "No difference" if not any(apart_m) else "Same recording, same configuration, different results"


def _sides(differences: Sequence[ConfigDifference]) -> tuple[str, str]:
    """The names of both sides: "A" and "B", with the value of the only setting that differs."""
    if len(differences) != 1:
        return "A", "B"
    (only,) = differences
    return f"A ({_short_value(only.first)})", f"B ({_short_value(only.second)})"


def _short_value(value: str) -> str:
    plain = value.strip('"')
    return plain if len(plain) <= LONGEST_VALUE else f"{plain[:LONGEST_VALUE]}…"


def _effects(flights: Pair) -> list[str]:
    """Sentences about the final estimates: distance between both, and each side's claim and error."""
    both = [(a, b) for a, b in zip(*_ends(flights), strict=True) if a is not None and b is not None]
    if not both:
        return ["No target was found in both."]
    apart_m = median(hypot(a.north - b.north, a.east - b.east) for a, b in both)
    of = "" if len(both) == 1 else f" (median of {len(both)} targets)"
    claims = [length(median(point.radius95_m for point in side)) for side in zip(*both, strict=True)]
    apart = f"{length(apart_m)} apart" if apart_m >= EQUAL_M else "equal"
    sentences = [f"Final estimates are {apart}{of}; claimed radius (95 %): A {claims[0]}, B {claims[1]}."]
    known = [(a.error_m, b.error_m) for a, b in both if a.error_m is not None and b.error_m is not None]
    if known:
        errors = [length(median(side)) for side in zip(*known, strict=True)]
        sentences.append(f"True error: A {errors[0]}, B {errors[1]}.")
    return sentences


def _maps(sides: tuple[str, str], names: tuple[str, str], flights: Pair) -> str:
    drawn = "".join(
        figure(f"{side}: {name}", flight_map(flight, other), _figures(flight))
        for side, name, flight, other in zip(sides, names, flights, reversed(flights), strict=True)
    )
    return f'<section class="two">{drawn}</section>'


def _figures(flight: FlightData) -> str:
    radii = [target.last.radius95_m for target in flight.targets if target.found and target.last]
    claim = f"; claimed radius, 95 %, median: {length(median(radii))}" if radii else ""
    targets = "1 target" if len(radii) == 1 else f"{len(radii)} targets"
    if flight.ghosts:
        targets += f" and {flight.ghosts} ghost{'s' if flight.ghosts > 1 else ''}"
    return f"{targets} from {flight.fixes} of {flight.detections} detections{claim}."


def pairs(flights: Pair) -> list[tuple[str, TargetSeries | None, TargetSeries | None]]:
    """(name, in A, in B) of each target; a target in both is one row, whatever its track numbers are."""
    ours, theirs = flights
    left = list(theirs.targets)
    found: list[tuple[str, TargetSeries | None, TargetSeries | None]] = []
    for target in ours.targets:
        same = next((each for each in left if _is_same(target, each)), None)
        if same is not None:
            left.remove(same)
        found.append((target.name, target, same))
    return [*found, *((target.name, None, target) for target in left)]


def _is_same(ours: TargetSeries, theirs: TargetSeries) -> bool:
    """Whether A's target has B's estimate as its variant; where one side found nothing, whether both truths agree."""
    variant = ours.variants[0].last if ours.variants else None
    if variant is not None and theirs.last is not None:
        return (variant.north, variant.east) == (theirs.last.north, theirs.last.east)
    found_in_both = ours.last is not None and theirs.last is not None
    return not found_in_both and ours.true_ned is not None and ours.true_ned == theirs.true_ned


def _columns(flights: Pair) -> tuple[list[TargetSeries | None], list[TargetSeries | None]]:
    found = pairs(flights)
    return [ours for _, ours, _ in found], [theirs for _, _, theirs in found]


def _ends(flights: Pair) -> tuple[list[SeriesPoint | None], list[SeriesPoint | None]]:
    """The final estimates of each row of :func:`pairs`."""
    first, second = ([each.last if each is not None else None for each in column] for column in _columns(flights))
    return first, second


def _table(sides: tuple[str, str], flights: Pair) -> str:
    """Final claims, true errors where a truth is known, and the distance between both sides."""
    rows = pairs(flights)
    has_truth = any(errors_of(target.points) for _, *both in rows for target in both if target is not None)
    body = [
        f"<tr><td>{escape(name)}</td>{_cells(ours, has_truth=has_truth)}{_cells(theirs, has_truth=has_truth)}"
        f"<td>{'' if (apart_m := _apart_m(ours, theirs)) is None else table_length(apart_m)}</td></tr>"
        for name, ours, theirs in rows
    ]
    columns = ["claimed 95 %", *["true error"] * has_truth]
    head = [f"{side} {column}" for side in sides for column in columns]
    return section("At the end", "", table(["target", *head, "distance"], body))


def _cells(target: TargetSeries | None, *, has_truth: bool) -> str:
    last = target.last if target is not None else None
    if last is None:
        return f'<td colspan="{1 + has_truth}">not found</td>'
    error = "" if last.error_m is None else table_length(last.error_m)
    return f"<td>{table_length(last.radius95_m)}</td>" + (f"<td>{error}</td>" if has_truth else "")


def _apart_m(ours: TargetSeries | None, theirs: TargetSeries | None) -> float | None:
    """Distance between the final estimates, metres; None where a side has none."""
    if ours is None or theirs is None or ours.last is None or theirs.last is None:
        return None
    return hypot(ours.last.north - theirs.last.north, ours.last.east - theirs.last.east)


def _error_charts(sides: tuple[str, str], flights: Pair) -> str:
    charts = [
        (f"{side}: {name}", target, flights[0].seconds)
        for name, *both in pairs(flights)
        for side, target in zip(sides, both, strict=True)
        if target is not None and errors_of(target.points)
    ]
    if not charts:
        return ""
    top_m = scale_top_m([target for _, target, _ in charts])
    drawn = "".join(figure(title, error_chart(target, seconds, top_m)) for title, target, seconds in charts)
    entries = [("ours", "line", "error"), ("claim", "area", "claimed, 95 %"), ("fix", "dot", "one sighting alone")]
    heading = "Error over time, and the claimed 95 % radius"
    return section(heading, "All charts have the same scale.", f'{key(entries)}<div class="grid pairs">{drawn}</div>')
