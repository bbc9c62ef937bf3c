"""The comparison as text and as one JSON object."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import msgspec

from fwav_companion.tools.paper.comparison import TABLE_I, PaperComparison, Quantity

COLUMNS = ("mean_x", "var_x", "mean_y", "var_y")
WIDTH, COLUMN = 52, 19


def as_object(comparison: PaperComparison, seed: int, runs: int) -> dict[str, Any]:
    """The object for --json."""
    return {"seed": seed, "runs": runs, "table_i": TABLE_I, **msgspec.to_builtins(comparison)}


def as_text(comparison: PaperComparison, seed: int, runs: int) -> str:
    """A table and the conclusions from it."""
    return "\n".join((*_table(comparison, seed, runs), "", *_sources(comparison), "", *_conclusions(comparison)))


def _table(comparison: PaperComparison, seed: int, runs: int) -> Iterator[str]:
    yield f"Metres and square metres; truth X = 4, Y = 3; variances with ddof = 0. Medians of {runs} runs of 90"
    yield f"samples, seed {seed}, with one sigma of how the median itself varies from seed to seed; below each the"
    yield "range of 90 of 100 single runs, and the first run, which the figures show."
    yield f"{'':{WIDTH}}" + "".join(f"{name:>{COLUMN}}" for name in ("mean X", "var X", "mean Y", "var Y"))
    for name, numbers in TABLE_I.items():
        yield f"{'Table I, ' + name:{WIDTH}}" + "".join(f"{numbers[column]:{COLUMN}.2f}" for column in COLUMNS)
    for row in comparison.rows:
        quantities: list[Quantity] = [getattr(row, column) for column in COLUMNS]
        yield f"{row.name:{WIDTH}}" + "".join(
            f"{f'{q.median:#.4g} ±{q.median_sigma:.1g}':>{COLUMN}}" for q in quantities
        )
        yield f"{'    90 of 100 runs':{WIDTH}}" + "".join(
            f"{f'{q.low:.3g}..{q.high:.3g}':>{COLUMN}}" for q in quantities
        )
        yield f"{'    one run':{WIDTH}}" + "".join(f"{q.one_run:{COLUMN}.4g}" for q in quantities)


def _sources(comparison: PaperComparison) -> Iterator[str]:
    yield f"{'RMS error by one cause alone, m':{WIDTH}}{'X':>{COLUMN}}{'Y':>{COLUMN}}"
    for name, (x, y) in comparison.rms_by_source_m.items():
        yield f"{name:{WIDTH}}{x:{COLUMN}.3f}{y:{COLUMN}.3f}"


def _conclusions(comparison: PaperComparison) -> Iterator[str]:
    refused = sum(row.refused for row in comparison.rows)
    yield "What holds: the geometry. Without noise the fix is exact; with the stated noise it is good to 0.2 m."
    yield (
        f"What holds: the filter's noise ratio, alpha / (2 - alpha) = {comparison.variance_ratio_theory:.4f}; measured "
        f"{comparison.variance_ratio:.4f}, Table I has 0.066 for X."
    )
    yield "What does not: Table I does not follow from 4 px. A detection noise of about one millimetre (188 px) gives"
    yield "  it; its means beyond 4 and 3 are then the convexity of the tangent."
    yield (
        "What does not: the filter brings the mean no closer to the truth. Started at 0 it multiplies any mean by "
        f"{comparison.start_ratio:.3f};"
    )
    yield "  with the stated noise that start makes X and Y worse by a tenth. Started at its first sample it leaves the"
    yield "  mean alone."
    yield "What is left out: a flapping body. Along the flight an attitude that is up to 20 ms old costs more than all"
    yield "  the stated noise; it is periodic and biased, and no averaging removes it. Pair pictures and attitudes in"
    yield "  time first."
    yield f"Rays at or above the horizon do not meet the ground: {refused} samples were rejected."
