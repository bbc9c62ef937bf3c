"""Real roots of small polynomials, in order: where a lens model folds back on itself."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise


def value(coefficients: Sequence[float], x: float) -> float:
    """The polynomial at x; ``coefficients[i]`` belongs to x^i."""
    total = 0.0
    for coefficient in reversed(coefficients):
        total = total * x + coefficient
    return total


def derivative(coefficients: Sequence[float]) -> tuple[float, ...]:
    """The coefficients of the derivative."""
    return tuple(i * coefficient for i, coefficient in enumerate(coefficients))[1:]


def first_not_positive(coefficients: Sequence[float], end: float) -> float | None:
    """The smallest x in [0, end] where the polynomial is not positive; None where it is positive throughout.

    Between neighbouring turning points a polynomial is monotone, so looking at those misses nothing, not even a root
    where it only touches zero.
    """
    if value(coefficients, 0.0) <= 0.0:
        return 0.0
    low = 0.0
    for high in (*turning_points(coefficients, end), end):
        if value(coefficients, high) <= 0.0:
            return _crossing(coefficients, low, high)
        low = high
    return None


def turning_points(coefficients: Sequence[float], end: float) -> list[float]:
    """Ascending places in (0, end) where the derivative changes its sign or touches zero."""
    slope = derivative(coefficients)
    if len(slope) < 2:
        return []
    edges = [0.0, *turning_points(slope, end), end]
    found: list[float] = []
    for low, high in pairwise(edges):
        at_low, at_high = value(slope, low), value(slope, high)
        if at_high == 0.0 or (at_low < 0.0) != (at_high < 0.0):
            found.append(_crossing(slope, low, high))
    return found


def _crossing(coefficients: Sequence[float], low: float, high: float) -> float:
    """Where the sign at ``low`` ends, by bisection down to neighbouring floats."""
    negative = value(coefficients, low) < 0.0
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return high
        at_middle = value(coefficients, middle)
        if at_middle != 0.0 and (at_middle < 0.0) == negative:
            low = middle
        else:
            high = middle
