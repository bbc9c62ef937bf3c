"""Settings against the recorded ones, paired by flight: medians with intervals, sign tests, which flights got worse.

PURE. The interval of a paired median is that of its order statistics, which is exact for any distribution; the sign
test is two-sided, with Holm's correction over the settings (Holm 1979).
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Final

import msgspec
from scipy.stats import binom, binomtest

from fwav_companion.tools.study.setting_record import AS_RECORDED, MEASURES, Measure, SettingRecord

LEAST_PAIRS: Final = 6
"""Fewest pairs whose range is a 95 % interval of their median: 2 (1/2)^6 = 3 %."""
SAME: Final = 1e-9
"""Relative difference below which two values are a tie: replays agree to rounding."""


class ChangedFlight(msgspec.Struct, frozen=True):
    """A flight that a setting changed."""

    flight: str
    before: float
    after: float


class MeasureComparison(msgspec.Struct, frozen=True, kw_only=True):
    """One measure under one setting against the recorded one."""

    measure: Measure
    setting: int
    pairs: int
    before: float
    """Median over the paired flights."""
    after: float
    change: float
    """Median of the paired differences of the distances from the ideal value, after minus before."""
    interval: tuple[float, float] | None
    """95 % interval of ``change``; None with too few pairs."""
    better: int
    worse: int
    p: float
    """p-value of the two-sided sign test."""
    p_holm: float
    """p-value corrected for the number of settings."""
    got_worse: tuple[ChangedFlight, ...]
    """The flights that got worse, the most first."""

    @property
    def verdict(self) -> str:
        """The words better, worse, or no difference shown, at 5 % after the correction."""
        if self.p_holm > 0.05 or self.better == self.worse:
            return "no difference shown"
        return "better" if self.better > self.worse else "worse"


def compared(records: Sequence[SettingRecord], settings: int) -> list[MeasureComparison]:
    """Every measure that flights have, under each of the settings 1 to ``settings``."""
    values = {(record.flight, record.setting): record for record in records if not record.damage}
    flights = sorted({flight for flight, _ in values})
    found = []
    for measure in MEASURES:
        rows = [_compared(measure, number, values, flights) for number in range(1, settings + 1)]
        found += _corrected([row for row in rows if row is not None])
    return found


def holm(ps: Sequence[float]) -> list[float]:
    """Holm's step-down corrected values, in the order of ``ps``."""
    order = sorted(range(len(ps)), key=lambda i: ps[i])
    corrected, largest = [0.0] * len(ps), 0.0
    for rank, i in enumerate(order):
        largest = max(largest, min(1.0, (len(ps) - rank) * ps[i]))
        corrected[i] = largest
    return corrected


def median_interval(differences: Sequence[float]) -> tuple[float, float] | None:
    """The 95 % interval of the median by order statistics; None with too few values."""
    n = len(differences)
    if n < LEAST_PAIRS:
        return None
    ordered = sorted(differences)
    k = int(binom.ppf(0.025, n, 0.5))
    return ordered[max(0, k - 1)], ordered[min(n - 1, n - k)]


def _compared(
    measure: Measure, number: int, values: dict[tuple[str, int], SettingRecord], flights: Sequence[str]
) -> MeasureComparison | None:
    pairs = []
    for flight in flights:
        before, after = (
            getattr(values.get((flight, setting)), measure.field, None) for setting in (AS_RECORDED, number)
        )
        if before is not None and after is not None:
            pairs.append(ChangedFlight(flight, before, after))
    if not pairs:
        return None
    distances = [(measure.distance(each.before), measure.distance(each.after)) for each in pairs]
    differences = [_tied(after - before, before) for before, after in distances]
    better, worse = sum(d < 0.0 for d in differences), sum(d > 0.0 for d in differences)
    p = float(binomtest(min(better, worse), better + worse, 0.5).pvalue) if better + worse else 1.0
    by_change = sorted(zip(differences, pairs, strict=True), key=lambda item: -item[0])
    return MeasureComparison(
        measure=measure,
        setting=number,
        pairs=len(pairs),
        before=median(each.before for each in pairs),
        after=median(each.after for each in pairs),
        change=median(differences),
        interval=median_interval(differences),
        better=better,
        worse=worse,
        p=p,
        p_holm=p,
        got_worse=tuple(flight for change, flight in by_change if change > 0.0),
    )


def _tied(difference: float, value: float) -> float:
    return 0.0 if abs(difference) <= SAME * max(1.0, abs(value)) else difference


def _corrected(rows: Sequence[MeasureComparison]) -> list[MeasureComparison]:
    corrected = holm([row.p for row in rows])
    return [msgspec.structs.replace(row, p_holm=p) for row, p in zip(rows, corrected, strict=True)]
