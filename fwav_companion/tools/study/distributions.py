"""Statistics over flights: quantiles, shares with their confidence, bootstrap intervals. PURE: the same every time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from fwav_companion.recording.error_statistics import wilson

Floats: TypeAlias = NDArray[np.float64]

RESAMPLES: Final = 1000
"""Bootstrap resamples: the ends of a 95 % interval then vary by 3 % of its width."""
PART: Final = 50
"""Resamples at a time."""


class IntervalEstimate(msgspec.Struct, frozen=True):
    """An estimate with its 95 % interval."""

    value: float
    low: float
    high: float


class ErrorQuantiles(msgspec.Struct, frozen=True):
    """Errors that half, 90 % and 95 % of flights stay below, metres."""

    half: IntervalEstimate
    nine_tenths: IntervalEstimate
    most: IntervalEstimate


def share_of(inside: int, n: int) -> IntervalEstimate:
    """A share with its interval (Wilson 1927); of no flights it is unknown between 0 and 1."""
    if n == 0:
        return IntervalEstimate(0.0, 0.0, 1.0)
    return IntervalEstimate(inside / n, *wilson(inside / n, n))


def bootstrap(values: Sequence[float], statistic: Callable[[Floats], Floats]) -> IntervalEstimate:
    """A statistic with its percentile bootstrap interval (Efron 1979). ``statistic`` is over the last axis."""
    sample = np.asarray(values, dtype=np.float64)
    rng, n = np.random.default_rng(0), len(sample)
    # In parts: all resamples of 10 000 flights at once take 160 MiB.
    parts = [statistic(sample[rng.integers(0, n, (PART, n))]) for _ in range(RESAMPLES // PART)]
    low, high = np.quantile(np.concatenate(parts), (0.025, 0.975))
    return IntervalEstimate(float(statistic(sample)), float(low), float(high))


def quantile_interval(values: Sequence[float], share: float) -> IntervalEstimate:
    """A quantile with its bootstrap interval."""
    return bootstrap(values, lambda drawn: np.quantile(drawn, share, axis=-1))


def error_quantiles(errors_m: Sequence[float]) -> ErrorQuantiles | None:
    """The quantiles; None without an error."""
    if not errors_m:
        return None
    return ErrorQuantiles(*(quantile_interval(errors_m, share) for share in (0.5, 0.9, 0.95)))


def paired_median(before: Sequence[float], after: Sequence[float]) -> IntervalEstimate:
    """The median of the paired differences, after minus before, with its bootstrap interval."""
    return quantile_interval(list(np.subtract(after, before)), 0.5)


def binned(values: Sequence[float], most_bins: int = 8, least: int = 8) -> list[list[int]]:
    """Indices of the values in bins of equal counts, by size: at most ``most_bins``, of at least ``least`` values."""
    order = np.argsort(np.asarray(values), kind="stable")
    bins = max(1, min(most_bins, len(values) // least))
    return [part.tolist() for part in np.array_split(order, bins)] if len(values) else []
