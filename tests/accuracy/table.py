"""The results as Markdown: the table of one run, and two runs beside each other, paired by flight. PURE."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, inf, isfinite, sqrt
from statistics import mean, median
from typing import NamedTuple

import msgspec

from tests.accuracy.scores import FlightScore, KindScore, kind_score

MOST_RATIO, MOST_MORE_M = 1.10, 0.003
"""A kind is as good as before within either."""
SHARE = 0.8
EXPLAINED = """Errors: root mean square over the targets' public lines from 30 %
of the flight on, median / worst flight. Squares: normalised, mean / worst flight; 2 is honest. Inside: share within the
claimed 95 %, relative / absolute. Calibrated: flights, median seconds from first sight. Work: million instructions a
flight second of the first 20 s, whole replay. Made by `python -m tests.accuracy --out FILE`."""
COMPARED = f"""Relative errors, medians of the flights in metres, over the instants that both have; the median of the
flights' ratios with its {SHARE:.0%} interval. Kept: a ratio of at most {MOST_RATIO:.2f}, or {1e3 * MOST_MORE_M:.0f} mm
more. Squares: normalised, relative, mean of the flights."""


class Run(msgspec.Struct, frozen=True, kw_only=True):
    """All flights of one run."""

    estimator: str
    date: str
    """The date from which seeds were drawn; empty: seeds from 1."""
    commit: str
    kinds: dict[str, list[FlightScore]]
    instructions_m: dict[str, float] = {}
    """Million instructions a flight second, of the first 20 s of the first flight of a kind."""


class Paired(NamedTuple):
    """One kind of two runs, over the flights and the instants that both have."""

    flights: int
    before_m: float
    after_m: float
    """Medians of the flights' errors."""
    ratio: float
    """Median ratio, after over before."""
    low: float
    high: float
    """Interval of the median ratio, at least SHARE."""
    more_m: float
    """Median difference, after minus before."""

    @property
    def is_kept(self) -> bool:
        """Whether the later run is as good as the earlier one."""
        return self.ratio <= MOST_RATIO or self.more_m <= MOST_MORE_M


def interval_of_median(values: Sequence[float], share: float = SHARE) -> tuple[float, float]:
    """The narrowest symmetric pair of order statistics that holds the median with at least this probability.

    Distribution-free: the number of values below the median is binomial (Conover 1999, ch. 3). All values where they
    are too few.
    """
    ordered, n = sorted(values), len(values)
    outside, rank = 0.0, 0
    while rank < n // 2 and 2.0 * (outside + comb(n, rank) * 0.5**n) <= 1.0 - share:
        outside += comb(n, rank) * 0.5**n
        rank += 1
    rank = max(0, rank - 1)
    return ordered[rank], ordered[n - 1 - rank]


def paired(before: Sequence[FlightScore], after: Sequence[FlightScore]) -> Paired | None:
    """One kind of two runs; None without a common instant."""
    others = {each.seed: each for each in after}
    errors = [errors for each in before if each.seed in others and (errors := _common(each, others[each.seed]))]
    if not errors:
        return None
    ratios = [b / a if a > 0.0 else inf for a, b in errors]
    low, high = interval_of_median(ratios)
    first, second = (median(each) for each in zip(*errors, strict=True))
    return Paired(len(errors), first, second, median(ratios), low, high, median(b - a for a, b in errors))


def _common(one: FlightScore, other: FlightScore) -> tuple[float, float] | None:
    """Root mean squares of both over the targets and parts of the flight in which both answered."""
    pairs = [
        (a, b)
        for target in one.cells.keys() & other.cells.keys()
        for a, b in zip(one.cells[target], other.cells[target], strict=True)
        if a is not None and b is not None
    ]
    if not pairs:
        return None
    a, b = (sqrt(mean(value * value for value in values)) for values in zip(*pairs, strict=True))
    return a, b


def run_table(run: Run) -> str:
    """The table of one run."""
    seeds = f"seeds drawn from {run.date}" if run.date else "seeds from 1"
    lines = [
        f"# Accuracy by kind of flight: estimator `{run.estimator}`\n\nAt commit {run.commit}, {seeds}. {EXPLAINED}\n",
        *_head("kind", "flights", "relative m", "absolute m", "squares, relative", "squares, absolute", "inside %",
               "calibrated", "missed", "ghosts", "CPU s", "work"),
    ]  # fmt: skip
    lines += [_row(name, kind_score(flights), run.instructions_m.get(name)) for name, flights in run.kinds.items()]
    return "\n".join(lines) + "\n"


def _head(*names: str) -> tuple[str, str]:
    return f"| {' | '.join(names)} |", "|---" * len(names) + "|"


def _row(name: str, kind: KindScore, work_m: float | None) -> str:
    answered = f"{kind.flights}" if kind.answered == kind.flights else f"{kind.answered} of {kind.flights}"
    after = f", {kind.calibrated_s:.0f} s" if isfinite(kind.calibrated_s) else ""
    cells = [
        name.replace("_", " "), answered, _pair(kind.relative_m, ".3f"), _pair(kind.absolute_m, ".3f"),
        _pair(kind.relative_square, ".2g"), _pair(kind.absolute_square, ".2g"),
        f"{100 * kind.relative_inside:.0f} / {100 * kind.absolute_inside:.0f}", f"{kind.calibrated}{after}",
        f"{kind.missed} of {kind.targets}", f"{kind.ghosts}", f"{kind.cpu_s:.1f}", f"{work_m:.0f}" if work_m else "",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _pair(values: tuple[float, float], form: str) -> str:
    return " / ".join(f"{value:.0f}" if value >= 100 else f"{value:{form}}" for value in values)


def comparison_table(before: Run, after: Run) -> str:
    """Two runs, paired by kind and seed, at the instants that both have."""
    lines = [
        f"# Accuracy: `{after.estimator}` against `{before.estimator}`\n\n{COMPARED}\n",
        *_head("kind", "flights", before.estimator, after.estimator, "ratio", "interval", "kept", "squares", "missed",
               "ghosts", "CPU s", "work"),
    ]  # fmt: skip
    for name in before.kinds:
        if name in after.kinds and (pair := paired(before.kinds[name], after.kinds[name])) is not None:
            one, two = kind_score(before.kinds[name]), kind_score(after.kinds[name])
            work = [f"{run.instructions_m[name]:.0f}" for run in (before, after) if name in run.instructions_m]
            cells = [
                name.replace("_", " "), f"{pair.flights}", f"{pair.before_m:.3f}", f"{pair.after_m:.3f}",
                f"{pair.ratio:.2f}", f"{pair.low:.2f} to {pair.high:.2f}", "yes" if pair.is_kept else "**no**",
                f"{one.relative_square[0]:.2g}, {two.relative_square[0]:.2g}", f"{one.missed}, {two.missed}",
                f"{one.ghosts}, {two.ghosts}", f"{one.cpu_s:.1f}, {two.cpu_s:.1f}", ", ".join(work),
            ]  # fmt: skip
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
