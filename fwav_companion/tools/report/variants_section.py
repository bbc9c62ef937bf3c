"""The section that compares variants of the tracker on one recording: errors, claims, final values. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, hypot, log10

from fwav_companion.tools.report.drawing import WIDE_CHART, LogAxes, Point, drawing
from fwav_companion.tools.report.error_section import errors_of, strokes
from fwav_companion.tools.report.flight_data import FlightData
from fwav_companion.tools.report.page_elements import figure, key, row, section, table
from fwav_companion.tools.report.target_series import TargetSeries, VariantSeries
from fwav_companion.tools.report.wording import length, table_length

MOST_TARGETS = 6
"""Most targets with a chart: those with the most sightings."""
SMALLEST_M = 0.001
"""Lowest end of the logarithmic axis, metres."""
ALIKE = 1.5
"""Ratio of two final errors below which one flight does not separate the filters."""
ORDER = ("paper", "own", "plain", "calibrated")
"""Order of the variants: the simplest first."""


def variants_section(flight: FlightData, title: str = "The same flight in other variants", words: str = "") -> str:
    """A chart and a table for each target; empty for a recording that was tracked in one variant only."""
    targets = [each for each in flight.targets if each.found and any(other.points for other in each.variants)]
    targets = sorted(targets, key=lambda target: -len(target.fixes))[:MOST_TARGETS]
    if not targets:
        return ""
    drawn = [_chart_and_table(target, flight) for target in targets]
    return section(title, words or _words(targets), "".join(drawn))


def variants_of(target: TargetSeries, flight: FlightData) -> list[VariantSeries]:
    """All variants of one target, this replay's own among them, the simplest first."""
    own = VariantSeries(flight.variant.name, flight.variant.kind, target.points)
    return sorted([own, *target.variants], key=lambda variant: ORDER.index(variant.kind))


def _words(targets: Sequence[TargetSeries]) -> str:
    same = "Every filter had the same pictures and telemetry."
    if any(errors_of(target.points) for target in targets):
        return (
            f"{same} Solid: distance of each estimate from the truth, on a logarithmic scale. Dashed: claimed radius, "
            "which 95 % of the errors should not exceed."
        )
    return f"{same} The truth is not known: estimates and claims can only be compared with one another."


def _chart_and_table(target: TargetSeries, flight: FlightData) -> str:
    variants = variants_of(target, flight)
    entries = [(variant.kind, "line", variant.name) for variant in variants if variant.points]
    if any(errors_of(variant.points) for variant in variants):
        title = f"Distance from the truth: {target.name}"
        entries.append(("claimed", "line", "claimed radius, 95 %"))
    else:
        title = f"Claimed radius, 95 %: {target.name}"
    chart = figure(title, variants_chart(variants, flight.seconds, target.name), key=key(entries))
    at_the_end = figure("At the end", _final_table(target, variants, flight), _conclusion(variants))
    return f'<div class="two broad">{chart}{at_the_end}</div>'


def variants_chart(variants: Sequence[VariantSeries], seconds: float, name: str) -> str:
    """Errors as solid lines, claims as dashed lines, on a logarithmic axis; only claims without a truth."""
    errors = [error_m for variant in variants for _, error_m in errors_of(variant.points)]
    claims = [point.radius95_m for variant in variants for point in variant.points]
    axes = LogAxes((0.0, max(seconds, 1.0)), _decades(errors or claims, claims), WIDE_CHART)
    parts = axes.elements("seconds", "distance from the truth" if errors else "radius of the circle")
    for variant in variants:
        claimed = [(point.at_s, point.radius95_m) for point in variant.points]
        parts += strokes(axes, claimed, f"{'claimed' if errors else 'variant'} variant-{variant.kind}")
    for variant in variants:
        parts += strokes(axes, errors_of(variant.points), f"variant variant-{variant.kind}")
    return drawing(*axes.size, parts, f"{'Error' if errors else 'Claim'} of {name} over time, by filter")


def _decades(lines: Sequence[float], claims: Sequence[float]) -> Point:
    """Ends of the y axis; the lowest 2 % are cut off, since an estimate that crosses the truth has error zero."""
    ranked = sorted(lines)
    low = max(SMALLEST_M, ranked[len(ranked) // 50] if ranked else SMALLEST_M)
    low = 10.0 ** floor(log10(low))
    return low, max(1.3 * max([*lines, *claims], default=1.0), 10.0 * low)


def _final_table(target: TargetSeries, variants: Sequence[VariantSeries], flight: FlightData) -> str:
    has_truth = target.true_ned is not None
    head = ["", "claimed 95 %", "true error" if has_truth else "distance to ours"]
    return table(head, [_row(variant, target, flight, has_truth=has_truth) for variant in variants])


def _row(variant: VariantSeries, target: TargetSeries, flight: FlightData, *, has_truth: bool) -> str:
    last, ours = variant.last, target.last
    if last is None or ours is None:
        return row([variant.name, "not found", ""])
    if has_truth and last.error_m is not None:
        kind = "good" if last.error_m <= last.radius95_m else "off"
        return row([variant.name, table_length(last.radius95_m), table_length(last.error_m)], kind)
    if variant.name == flight.variant.name:
        return row([f"{variant.name} (ours)", table_length(last.radius95_m), "–"])
    apart_m = hypot(last.north - ours.north, last.east - ours.east)
    return row([variant.name, table_length(last.radius95_m), table_length(apart_m)])


def _conclusion(variants: Sequence[VariantSeries]) -> str:
    """The smallest and the largest final error in one sentence."""
    ends = [(each.last.error_m, each) for each in variants if each.last is not None and each.last.error_m is not None]
    if len(ends) < 2:
        return ""
    (best_m, best), (worst_m, worst) = (pick(ends, key=lambda end: end[0]) for pick in (min, max))
    if worst_m < ALIKE * best_m:
        return "The final errors are nearly equal: the largest error is common to all variants."
    return f"At the end {best.name} is {length(best_m)} from the truth, {worst.name} {length(worst_m)}."
