"""What limited it: each metre of a sighting charged to its cause, and what was not used at all. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from math import hypot

from fwav_companion.tools.report.markup import figure, row, section
from fwav_companion.tools.report.story import Story
from fwav_companion.tools.report.words import CAUSE_NAMES, REASONS, length, words

LEAST_M = 0.005
"""A cause below half a centimetre is not drawn."""


def causes(story: Story) -> str:
    """A section; empty where no sighting told its budget and nothing is known to have been wrong."""
    parts = [part for part in (budget(story), _hidden(story)) if part]
    return section("Why not better?", "", f'<div class="two">{"".join(parts)}</div>') if parts else ""


def budget(story: Story, title: str = "What one sighting can be off by") -> str:
    """A figure: each metre of a sighting charged to its cause."""
    bars = _bars(story.budget_m)
    if not bars:
        return ""
    told = (
        f"One sighting, one sigma on the ground, by its cause as the configuration states it; together "
        f"{length(hypot(*story.budget_m.values()))}. The longest bar is what to improve first. What self-calibration "
        "finds in flight makes its bars shorter."
    )
    return figure(title, bars, told)


def _hidden(story: Story) -> str:
    rows = [row([name, value]) for name, value in story.hidden.items()]
    told = (
        "Drawn from the configuration's own priors; the service was told none of it. An error of the vehicle's "
        "position moves all answers on the map the same way."
    )
    return figure("What was wrong with this vehicle", f"<table>{''.join(rows)}</table>", told) if rows else ""


def _bars(budget_m: Mapping[str, float]) -> str:
    most = max(budget_m.values(), default=0.0)
    rows = []
    for cause, sigma_m in sorted(budget_m.items(), key=lambda item: -item[1]):
        if sigma_m < LEAST_M:
            continue
        share = f"{100.0 * sigma_m / most:.1f}%"
        rows.append(
            f'<div class="bar-row"><span>{escape(CAUSE_NAMES.get(cause, cause))}</span>'
            f'<span class="track"><i style="width:{share}"></i></span><b>{length(sigma_m)}</b></div>'
        )
    return "".join(rows)


def not_used(story: Story) -> str:
    """What was dropped, and why."""
    total = f"{story.frames} frames were looked at, {story.detections} detections made, {story.fixes} used."
    if not story.dropped:
        return section("What was not used", f"{total} Nothing was dropped.", "")
    rows = "".join(
        f"<tr><td>{escape(words(reason))}</td><td>{count}</td><td>{escape(REASONS.get(reason, ''))}</td></tr>"
        for reason, count in sorted(story.dropped.items(), key=lambda item: -item[1])
    )
    return section(
        "What was not used, and why",
        f"{total} What cannot answer says so, by name.",
        f'<div class="scroll"><table class="reasons">{rows}</table></div>',
    )
