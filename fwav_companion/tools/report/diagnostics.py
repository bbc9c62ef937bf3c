"""Sections for a closer look at a flight: innovations of the tracks, and the clocks in detail. Pure."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from fwav_companion.recording.line_types import CalibrationLine, Line, TargetLine, header_of, line_unix_s
from fwav_companion.tools.report.clock_section import clock_offset_section
from fwav_companion.tools.report.drawing import LinearAxes, Point, circle, drawing, line, thinned
from fwav_companion.tools.report.flight_data import TIMED
from fwav_companion.tools.report.page_elements import figure, key, section

EXPECTED_NIS, NIS_95 = 2.0, 5.991
"""Mean and 95 % quantile of the normalised innovation squared, chi-square with 2 degrees of freedom."""
TOP_NIS = 4.0 * NIS_95
"""Top of the chart of normalised innovations squared."""
NEARLY_ALL = 0.97
"""Fraction of the innovations inside the chart's scale."""
MOST_POINTS = 600
AXES = (("fix", "dot", "north"), ("east", "dot", "east"))
INNOVATION = "Each sighting minus the prediction of its target: noise scatters about zero, a trend is an error."
BEFORE_CALIBRATION = (
    "Each sighting is drawn as it was measured, before the calibration of this flight: a trend is the error that "
    "self-calibration removes."
)


class InnovationSample(msgspec.Struct, frozen=True):
    """One sighting minus the prediction of its target."""

    at_s: float
    north_m: float
    east_m: float
    nis: float
    """Normalised innovation squared (NIS), 2 degrees of freedom."""


def diagnostics(lines: Sequence[Line]) -> list[str]:
    """Sections for :func:`~fwav_companion.tools.report.page`; a section without data is empty."""
    start = _start(lines)
    return [_innovation_section(lines, start), clock_offset_section(lines, start)]


def _start(lines: Sequence[Line]) -> float:
    """Unix time of the first line with a time."""
    header = header_of(lines)
    offset_s = 0.0 if header is None else header.unix_offset_s
    times = [line_unix_s(line, offset_s) for line in lines if isinstance(line, TIMED)]
    return min((at_s for at_s in times if at_s is not None), default=0.0)


def innovations(lines: Sequence[Line], start: float) -> list[InnovationSample]:
    """The innovations of confirmed tracks; empty where the replay did not write them."""
    confirmed = (line for line in lines if isinstance(line, TargetLine) and line.is_confirmed)
    return [
        InnovationSample(line.time_unix - start, found.north, found.east, found.distance2)
        for line in confirmed
        if (found := line.innovation) is not None
    ]


def _innovation_section(lines: Sequence[Line], start: float) -> str:
    found = innovations(lines, start)
    if not found:
        return ""
    seconds = max(each.at_s for each in found)
    mean = sum(each.nis for each in found) / len(found)
    beyond = 100.0 * sum(each.nis > NIS_95 for each in found) / len(found)
    caption = (
        f"The square of each innovation divided by its covariance. Mean: {mean:.2f}, expected {EXPECTED_NIS:g}. Above "
        f"{NIS_95:g}: {beyond:.0f} %, expected 5 %. Larger values: the errors are larger than [uncertainty] states. "
        "Smaller values: [uncertainty] states too much, or this flight's constant errors were small."
    )
    entries = key([("fix", "dot", "one sighting"), ("ours", "line", f"expected mean, {EXPECTED_NIS:g}"),
                   ("bound", "line", f"95 % are below, {NIS_95:g}")])  # fmt: skip
    figures = figure("Innovations", _innovation_chart(found, seconds), INNOVATION, key=key(AXES))
    figures += figure("Normalised innovations squared", _nis_chart(found, seconds), caption, key=entries)
    words = BEFORE_CALIBRATION if any(isinstance(line, CalibrationLine) for line in lines) else ""
    return section("Do the sightings agree with one another?", words, f'<div class="two">{figures}</div>')


def _innovation_chart(found: Sequence[InnovationSample], seconds: float) -> str:
    largest = sorted(max(abs(each.north_m), abs(each.east_m)) for each in found)
    top_m = max(0.1, 1.2 * largest[int(NEARLY_ALL * (len(largest) - 1))])
    axes = LinearAxes((0.0, max(1.0, seconds)), (-top_m, top_m))
    parts = axes.elements("seconds", "metres")
    for kind, points in (
        ("east", [(each.at_s, each.east_m) for each in found]),
        ("fix", [(each.at_s, each.north_m) for each in found]),
    ):
        parts += _dots(axes, points, kind)
    return drawing(*axes.size, parts, "Innovations")


def _nis_chart(found: Sequence[InnovationSample], seconds: float) -> str:
    axes = LinearAxes((0.0, max(1.0, seconds)), (0.0, TOP_NIS))
    parts = axes.elements("seconds", "normalised innovation squared")
    parts += _dots(axes, [(each.at_s, each.nis) for each in found], "fix")
    for level, kind in ((EXPECTED_NIS, "ours"), (NIS_95, "bound")):
        parts.append(line(axes.at(0.0, level), axes.at(max(1.0, seconds), level), kind))
    return drawing(*axes.size, parts, "Normalised innovations squared")


def _dots(axes: LinearAxes, points: Sequence[Point], kind: str) -> list[str]:
    return [circle(axes.at(*point), 1.7, kind) for point in thinned(points, MOST_POINTS)]
