"""The report of one flight: a self-contained HTML page, light or dark, readable on a phone. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import msgspec

from fwav_companion.tools.report.calibration_section import calibration_section
from fwav_companion.tools.report.clock_section import timing_section
from fwav_companion.tools.report.error_budget import budget_figure, budget_section, not_used_section
from fwav_companion.tools.report.error_section import error_section
from fwav_companion.tools.report.final_section import final_section
from fwav_companion.tools.report.flight_data import FlightData
from fwav_companion.tools.report.landing_section import landing_section
from fwav_companion.tools.report.map_section import map_section
from fwav_companion.tools.report.page_elements import document
from fwav_companion.tools.report.summary_section import SecondResult, summary_section
from fwav_companion.tools.report.variants_section import variants_section


class SecondFlight(msgspec.Struct, frozen=True):
    """Another flight in the same report."""

    sections: list[str]
    result: SecondResult


def page(flight: FlightData, more: Iterable[str] = (), second: SecondFlight | None = None) -> str:
    """The HTML file; ``more``: sections for a closer look, as :func:`diagnostics` makes them."""
    # The budget is on the first screen where no picture takes its place.
    budget = budget_figure(flight, "What limits the accuracy") if flight.picture is None else ""
    sections = [
        summary_section(flight, second.result if second else None),
        map_section(flight, budget),
        f'<div class="chapter">{"".join(second.sections)}</div>' if second else "",
        landing_section(flight.landing),
        final_section(flight.final),
        variants_section(flight),
        calibration_section(flight),
        error_section(flight),
        "" if budget else budget_section(flight),
        timing_section(flight),
        *more,
        not_used_section(flight),
        _foot(flight),
    ]
    return document(flight.title, sections)


def _foot(flight: FlightData) -> str:
    origin = flight.origin
    height = f", {origin.alt_amsl_m:.1f} m AMSL" if origin and flight.has_altitude else ""
    where = f"Origin {origin.lat_deg:.7f}, {origin.lon_deg:.7f}{height}. " if origin else ""
    notes = "".join(f"<p>{escape(note)}</p>" for note in flight.notes)
    return f"<footer>{notes}<p>{where}fwav-companion {escape(flight.version)}.</p></footer>"
