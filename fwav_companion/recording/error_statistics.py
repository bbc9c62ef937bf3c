"""Statistics of horizontal errors and of their reported covariances. PURE."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, isfinite, log, sqrt
from typing import Final

import msgspec

from fwav_companion.geometry.ellipses import NORMAL_95

CHI2_95: Final = -2.0 * log(0.05)
CHI2_999: Final = -2.0 * log(0.001)
"""Quantiles of chi-square with 2 degrees of freedom."""
LEAST_CORRELATION: Final = 0.05
"""Autocorrelation at which the sum of autocorrelations ends."""
MOST_COMPARED: Final = 2000
"""Most samples of one target in the autocorrelation, taken evenly from all: more would take minutes and show no
more."""


class ErrorSample(msgspec.Struct, frozen=True, gc=False):
    """Error of one estimate."""

    error_m: float
    """Horizontal distance from the truth, metres."""
    normalised2: float
    """Square of the error over the reported covariance, 2 degrees of freedom."""


class Coverage(msgspec.Struct, frozen=True, kw_only=True):
    """The errors that are inside their reported 95 % ellipses."""

    n: int
    inside: int
    low: float
    """The 95 % interval of the true share (Wilson 1927) for the number of independent samples that the correlation in
    time leaves."""
    high: float


class ErrorStatistics(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Statistics over samples, in metres; without a sample only their number is written."""

    samples: int
    rms_m: float | None = None
    ce50_m: float | None = None
    """Radius that contains 50 % of the errors."""
    ce90_m: float | None = None
    coverage95: Coverage | None = None
    nees: float | None = None
    """Mean normalised square: 2 where the covariances are right."""


def error_statistics(series: Sequence[Sequence[ErrorSample]]) -> ErrorStatistics:
    """Statistics over all samples; ``series``: the samples of one target each, in order of time."""
    samples = [sample for each in series for sample in each]
    if not samples:
        return ErrorStatistics(samples=0)
    errors = sorted(sample.error_m for sample in samples)
    inside = sum(sample.normalised2 <= CHI2_95 for sample in samples)
    independent = sum(_independent_count([sample.normalised2 for sample in each]) for each in series if each)
    low, high = wilson(inside / len(samples), independent)
    return ErrorStatistics(
        samples=len(samples),
        rms_m=sqrt(sum(error * error for error in errors) / len(errors)),
        ce50_m=_quantile(errors, 0.5),
        ce90_m=_quantile(errors, 0.9),
        coverage95=Coverage(n=len(samples), inside=inside, low=low, high=high),
        nees=sum(sample.normalised2 for sample in samples) / len(samples),
    )


def wilson(share: float, n: float) -> tuple[float, float]:
    """The 95 % interval of a share that was observed in ``n`` independent samples."""
    z2 = NORMAL_95 * NORMAL_95
    middle = (share + 0.5 * z2 / n) / (1.0 + z2 / n)
    half = NORMAL_95 * sqrt(share * (1.0 - share) / n + 0.25 * z2 / (n * n)) / (1.0 + z2 / n)
    return max(0.0, middle - half), min(1.0, middle + half)


def _quantile(ordered: Sequence[float], share: float) -> float:
    return ordered[max(0, ceil(share * len(ordered)) - 1)]


def _independent_count(values: Sequence[float]) -> float:
    """Effective number of independent samples in these, which are in order of time: n / (1 + 2 sum of correlations)."""
    finite = [value for value in values[:: ceil(len(values) / MOST_COMPARED)] if isfinite(value)]
    n = len(finite)
    if n < 3:
        return float(max(1, n))
    mean = sum(finite) / n
    off = [value - mean for value in finite]
    variance = sum(value * value for value in off)
    if variance <= 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, n - 1):
        correlation = sum(a * b for a, b in zip(off, off[lag:], strict=False)) / variance
        if correlation < LEAST_CORRELATION:
            break
        total += 2.0 * correlation
    return max(1.0, n / total)
