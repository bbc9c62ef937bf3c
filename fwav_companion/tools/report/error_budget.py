"""Sections about limits: the error budget of a sighting, true errors of the vehicle, and what was not used. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from math import hypot

from fwav_companion.tools.reason_table import words_of
from fwav_companion.tools.report.flight_data import FlightData
from fwav_companion.tools.report.page_elements import figure, row, section
from fwav_companion.tools.report.wording import CAUSE_NAMES, length, spaced

SMALLEST_M = 0.005
"""Smallest error with a bar, metres."""


def budget_section(flight: FlightData) -> str:
    """The error budget, and the vehicle's true errors where they are known; empty without either."""
    parts = [part for part in (budget_figure(flight), _hidden_figure(flight)) if part]
    return section("What limits the accuracy", "", f'<div class="two">{"".join(parts)}</div>') if parts else ""


def budget_figure(flight: FlightData, title: str = "Error budget of one sighting") -> str:
    """A bar for each cause of error; empty without an error budget."""
    bars = _bars(flight.budget95_m)
    if not bars:
        return ""
    caption = (
        "95 % of the errors of one sighting on the ground are smaller, by cause, as the configuration states it; all "
        f"causes together: {length(hypot(*flight.budget95_m.values()))} (95 %). Improve the longest bar first. "
        "Self-calibration in flight makes its bars shorter."
    )
    return figure(title, bars, caption)


def _hidden_figure(flight: FlightData) -> str:
    rows = [row([name, value]) for name, value in flight.hidden.items()]
    caption = (
        "Drawn from the priors of the configuration; the service knew none of these values. An error of the vehicle's "
        "position moves all estimates on the map in the same way."
    )
    return figure("True errors of this vehicle", f"<table>{''.join(rows)}</table>", caption) if rows else ""


def _bars(budget95_m: Mapping[str, float]) -> str:
    largest_m = max(budget95_m.values(), default=0.0)
    rows = []
    for cause, error_m in sorted(budget95_m.items(), key=lambda item: -item[1]):
        if error_m < SMALLEST_M:
            continue
        width = f"{100.0 * error_m / largest_m:.1f}%"
        rows.append(
            f'<div class="bar-row"><span>{escape(CAUSE_NAMES.get(cause, cause))}</span>'
            f'<span class="track"><i style="width:{width}"></i></span><b>{length(error_m)}</b></div>'
        )
    return "".join(rows)


def not_used_section(flight: FlightData) -> str:
    """Counts of frames and of detections, apart, and the reasons why some were not used."""
    refused = sum(flight.refused_frames.values())
    lost = flight.detections - flight.fixes
    words = (
        f"Frames: {flight.frames} read, {refused} refused. Detections: {flight.detections} made, {flight.fixes} placed "
        f"on the ground, {lost} not placed."
    )
    rows = _reason_rows("frames", flight.refused_frames) + _reason_rows("detections", flight.refused_detections)
    if not rows:
        return section("What was not used", words, "")
    head = "<tr><th>refused</th><th>reason</th><th>count</th><th></th></tr>"
    drawn = f'<div class="scroll"><table class="reasons">{head}{rows}</table></div>'
    return section("What was not used, and why", words, drawn)


def _reason_rows(what: str, counts: Mapping[str, int]) -> str:
    return "".join(
        f"<tr><td>{what}</td><td>{escape(spaced(reason))}</td><td>{count}</td><td>{escape(words_of(reason))}</td></tr>"
        for reason, count in sorted(counts.items(), key=lambda item: -item[1])
    )
