"""The section about the targets by the whole flight, beside the estimates that were made in flight. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

import msgspec

from fwav_companion.geometry.ellipses import radius_95
from fwav_companion.recording.line_types import Line, TargetLine
from fwav_companion.recording.summary_types import FinalObject, SummaryLine
from fwav_companion.tools.report.page_elements import row, section, table
from fwav_companion.tools.report.target_series import TargetSeries
from fwav_companion.tools.report.wording import table_length
from fwav_companion.types import TrackState

SAME_M = 1e-6
"""Distance of two places that are the same estimate, metres."""
WORDS = (
    "Live is the estimate at the target's last frame, by what was known then. Final is the estimate by all of the "
    "flight's sightings together, also by those before delay and mount were known."
)


class FinalTarget(msgspec.Struct, frozen=True):
    """One target in flight and by the whole flight."""

    name: str
    live: tuple[float, float, float]
    """North, east and claimed 95 % radius, metres."""
    final: tuple[float, float, float]
    true_ned: tuple[float, float] | None


def final_targets(lines: Sequence[Line], targets: Sequence[TargetSeries]) -> list[FinalTarget]:
    """The targets of the summary's ``final`` with their last estimates in flight; empty where it has none."""
    ends = {line.track: line for line in lines if isinstance(line, TargetLine) and line.state is TrackState.CONFIRMED}
    found = []
    summary = lines[-1] if lines else None
    for final in (summary.final if isinstance(summary, SummaryLine) else None) or ():
        end = ends.get(final.track)
        if end is not None:
            series = next((each for each in targets if _is_end_of(each, end)), None)
            name = f"{end.label or 'target'} {final.track}" if series is None else series.name
            true_ned = None if series is None else series.true_ned
            found.append(FinalTarget(name, _place(end), _place(final), true_ned))
    return found


def _is_end_of(series: TargetSeries, line: TargetLine) -> bool:
    last = series.last
    return last is not None and hypot(last.north - line.north, last.east - line.east) < SAME_M


def _place(line: TargetLine | FinalObject) -> tuple[float, float, float]:
    return line.north, line.east, radius_95(line.cov)


def final_section(targets: Sequence[FinalTarget]) -> str:
    """A table of both; empty without a target."""
    if not targets:
        return ""
    has_truth = any(target.true_ned for target in targets)
    columns = ("north, m", "east, m", "claimed radius, 95 %", *(["error"] if has_truth else []))
    head = ["target", *(f"{when} {column}" for when in ("live", "final") for column in columns)]
    rows = [
        row([target.name, *_cells(target.live, target, has_truth), *_cells(target.final, target, has_truth)])
        for target in targets
    ]
    return section("By the whole flight", WORDS, table(head, rows))


def _cells(place: tuple[float, float, float], target: FinalTarget, has_truth: bool) -> list[str]:
    north, east, radius95_m = place
    cells = [f"{north:.2f}", f"{east:.2f}", table_length(radius95_m)]
    if has_truth:
        true = target.true_ned
        cells.append("" if true is None else table_length(hypot(north - true[0], east - true[1])))
    return cells
