"""The results as Markdown: the table of one run, and two runs beside each other, paired by flight. PURE."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import comb, inf, isfinite
from statistics import mean, median
from typing import NamedTuple

import msgspec

from tests.accuracy.scores import FlightScore, root_mean_square

MOST_RATIO, MOST_MORE_M = 1.10, 0.003
"""A kind is as good as before within either."""
SHARE = 0.8
EXPLAINED = """Errors: root mean square of the targets' public answers over the time
from 30 % of the flight on, median / worst flight. Squares: normalised, mean / worst flight; 2 is honest. Inside: share
within the claimed 95 %, relative / absolute. Calibrated: flights, median seconds from first sight. Work: million
instructions a flight second of the first 20 s, whole replay. Made by `python -m tests.accuracy --out FILE`."""
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
    ours, theirs = zip(*pairs, strict=True)
    return root_mean_square(ours), root_mean_square(theirs)


def run_table(run: Run) -> str:
    """The table of one run."""
    seeds = f"seeds drawn from {run.date}" if run.date else "seeds from 1"
    lines = [
        f"# Accuracy by kind of flight: estimator `{run.estimator}`\n\nAt commit {run.commit}, {seeds}. {EXPLAINED}\n",
        *_head("kind", "flights", "relative m", "absolute m", "squares, relative", "squares, absolute", "inside %",
               "calibrated", "missed", "ghosts", "CPU s", "work"),
    ]  # fmt: skip
    lines += [_row(name, flights, run.instructions_m.get(name)) for name, flights in run.kinds.items()]
    return "\n".join(lines) + "\n"


def _head(*names: str) -> tuple[str, str]:
    return f"| {' | '.join(names)} |", "|---" * len(names) + "|"


def _row(name: str, flights: Sequence[FlightScore], work_m: float | None) -> str:
    relative = [each.relative for each in flights if each.relative]
    absolute = [each.absolute for each in flights if each.absolute]
    after_s = sorted(inf if each.calibrated_s is None else each.calibrated_s for each in flights)
    calibrated = sum(map(isfinite, after_s))
    in_the_middle = f", {median(after_s):.0f} s" if isfinite(median(after_s)) else ""
    cells = [
        name.replace("_", " "),
        f"{len(flights)}" if len(relative) == len(flights) else f"{len(relative)} of {len(flights)}",
        *(_pair(median, [each.rms_m for each in errors], ".3f") for errors in (relative, absolute)),
        *(_pair(mean, [each.square for each in errors], ".2g") for errors in (relative, absolute)),
        " / ".join(f"{100 * mean(each.inside for each in errors):.0f}" for errors in (relative, absolute) if errors),
        f"{calibrated}{in_the_middle}",
        f"{sum(each.missed for each in flights)} of {sum(each.targets for each in flights)}",
        f"{sum(each.ghosts for each in flights)}",
        f"{sum(each.cpu_s for each in flights):.1f}",
        f"{work_m:.0f}" if work_m else "",
    ]
    return f"| {' | '.join(cells)} |"


def _pair(middle: Callable[[Sequence[float]], float], values: Sequence[float], form: str) -> str:
    found = (middle(values), max(values)) if values else ()
    return " / ".join(f"{value:.0f}" if value >= 100 else f"{value:{form}}" for value in found)


def comparison_table(before: Run, after: Run) -> str:
    """Two runs, paired by kind and seed, at the instants that both have."""
    lines = [
        f"# Accuracy: `{after.estimator}` against `{before.estimator}`\n\n{COMPARED}\n",
        *_head("kind", "flights", before.estimator, after.estimator, "ratio", "interval", "kept", "squares", "missed",
               "ghosts", "CPU s", "work"),
    ]  # fmt: skip
    for name in before.kinds:
        if name in after.kinds and (pair := paired(before.kinds[name], after.kinds[name])) is not None:
            both = (before.kinds[name], after.kinds[name])
            squares = [mean(each.relative.square for each in flights if each.relative) for flights in both]
            work = [f"{run.instructions_m[name]:.0f}" for run in (before, after) if name in run.instructions_m]
            cells = [
                name.replace("_", " "), f"{pair.flights}", f"{pair.before_m:.3f}", f"{pair.after_m:.3f}",
                f"{pair.ratio:.2f}", f"{pair.low:.2f} to {pair.high:.2f}", "yes" if pair.is_kept else "**no**",
                ", ".join(f"{square:.2g}" for square in squares),
                ", ".join(f"{sum(each.missed for each in flights)}" for flights in both),
                ", ".join(f"{sum(each.ghosts for each in flights)}" for flights in both),
                ", ".join(f"{sum(each.cpu_s for each in flights):.1f}" for flights in both), ", ".join(work),
            ]  # fmt: skip
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
