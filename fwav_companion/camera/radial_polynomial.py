"""The odd radial polynomial r(theta) = k1 theta + k2 theta^3 + ... + k5 theta^9, its fold and its inverse.

A ray needs no angle, only sin(theta) / r and cos(theta). Both are smooth functions of r^2, also at the centre, so a
table of cubic pieces gives a ray without root, sine or iteration. Near a fold the inverse turns steep and no polynomial
is good enough: the table ends there, and a safeguarded Newton iteration solves the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import cos, sin, sqrt
from typing import TypeAlias

import msgspec

Cubic: TypeAlias = tuple[float, float, float, float]
RayPiece: TypeAlias = tuple[float, float, float, float, float, float, float, float]
"""Four coefficients of sin(theta) / rho, then four of cos(theta); polynomials in rho^2."""

FEWEST_PIECES, MOST_PIECES = 256, 4096
"""The paper's lens needs the fewest, 100 kB and 2 ms; one that folds inside its image has the most, 1 MB and 30 ms."""
PIECE_TOLERANCE = 3e-13
"""Error of a unit ray's components, radians: 3e-10 px on a lens of 1000 px a radian."""


class RayTable(msgspec.Struct, frozen=True):
    """Cubic pieces that give a unit ray from a squared radius."""

    unit: float
    """Length of one unit of rho, millimetres: a piece is one unit of rho^2 wide."""
    pieces: tuple[RayPiece, ...]
    """Piece i is valid for i <= rho^2 < i + 1."""


def radius_and_slope(k: Sequence[float], theta: float) -> tuple[float, float]:
    """The radius r(theta) and its slope dr/dtheta."""
    k1, k2, k3, k4, k5 = k
    t = theta * theta
    return (
        theta * (k1 + t * (k2 + t * (k3 + t * (k4 + t * k5)))),
        k1 + t * (3.0 * k2 + t * (5.0 * k3 + t * (7.0 * k4 + t * 9.0 * k5))),
    )


def angle_from_radius(k: Sequence[float], radius: float, largest: float) -> float:
    """The angle theta in [0, largest] with r(theta) = radius, by Newton inside a bracket; r rises up to ``largest``."""
    low, high = 0.0, largest
    theta = min(radius / k[0], largest)
    for _ in range(100):
        r, slope = radius_and_slope(k, theta)
        if r > radius:
            high = theta
        else:
            low = theta
        following = theta - (r - radius) / slope if slope > 0.0 else low
        if abs(following - theta) <= 1e-16 * theta:
            return following
        if not low < following < high:
            following = 0.5 * (low + high)
            if not low < following < high:
                return following
        theta = following
    return theta


def ray_table(k: Sequence[float], largest: float) -> RayTable:
    """The table with the fewest pieces that covers all but the outermost sixteenth of the image's area."""
    edge_radius, _ = radius_and_slope(k, largest)
    count = FEWEST_PIECES
    while True:
        unit = edge_radius / sqrt(count)
        pieces = _accurate_pieces(k, largest, unit, count)
        if len(pieces) >= count - count // 16 or count >= MOST_PIECES:
            return RayTable(unit, pieces)
        count *= 4


def _accurate_pieces(k: Sequence[float], largest: float, unit: float, count: int) -> tuple[RayPiece, ...]:
    """The pieces from the centre outwards, up to the first whose error exceeds PIECE_TOLERANCE."""
    pieces: list[RayPiece] = []
    s0, c0 = _sine_and_cosine(k, 0.0, unit, largest)
    for i in range(count):
        s1, c1 = _sine_and_cosine(k, i + 1.0, unit, largest)
        sine, cosine = _cubic(s0, s1, i), _cubic(c0, c1, i)
        s_middle, c_middle = _sine_and_cosine(k, i + 0.5, unit, largest)
        if max(sqrt(i + 1.0) * _error(sine, s_middle, i + 0.5), _error(cosine, c_middle, i + 0.5)) > PIECE_TOLERANCE:
            break
        pieces.append((*sine, *cosine))
        s0, c0 = s1, c1
    return tuple(pieces)


_Jet: TypeAlias = tuple[float, float]
"""A value and its derivative by rho^2."""


def _sine_and_cosine(k: Sequence[float], rho2: float, unit: float, largest: float) -> tuple[_Jet, _Jet]:
    """Sin(theta) / rho and cos(theta), each with its derivative by rho^2."""
    rho = sqrt(rho2)
    if rho == 0.0:
        k1 = k[0] / unit
        return (1.0 / k1, -(k[1] / unit / k1 + 1.0 / 6.0) / k1**3), (1.0, -0.5 / k1**2)
    theta = angle_from_radius(k, rho * unit, largest)
    slope = radius_and_slope(k, theta)[1] / unit
    s, c = sin(theta) / rho, cos(theta)
    return (s, 0.5 * (c / slope - s) / rho2), (c, -0.5 * s / slope)


def _cubic(start: _Jet, end: _Jet, at: int) -> Cubic:
    """The cubic Hermite interpolant of both ends, as a polynomial in rho^2 itself, not in its fraction."""
    rise = end[0] - start[0]
    twist = start[1] + end[1] - 2.0 * rise
    bend = rise - start[1] - twist
    return (
        start[0] - at * (start[1] - at * (bend - at * twist)),
        start[1] - at * (2.0 * bend - 3.0 * at * twist),
        bend - 3.0 * at * twist,
        twist,
    )


def _error(coefficients: Cubic, exact: _Jet, rho2: float) -> float:
    return abs(value(coefficients, rho2) - exact[0])


def value(coefficients: Sequence[float], x: float) -> float:
    """The polynomial at x; ``coefficients[i]`` is the factor of x^i."""
    total = 0.0
    for coefficient in reversed(coefficients):
        total = total * x + coefficient
    return total


def first_not_positive(coefficients: Sequence[float], end: float) -> float | None:
    """The smallest x in [0, end] where the polynomial is not positive; None where it is positive on all of it.

    A polynomial is monotone between neighbouring turning points. Its sign at those and at the end therefore finds
    every root, also one where it only touches zero.
    """
    if value(coefficients, 0.0) <= 0.0:
        return 0.0
    low = 0.0
    for high in (*_turning_points(coefficients, end), end):
        if value(coefficients, high) <= 0.0:
            return _crossing(coefficients, low, high)
        low = high
    return None


def _turning_points(coefficients: Sequence[float], end: float) -> list[float]:
    """The ascending places in (0, end) where the derivative changes its sign or touches zero."""
    slope = tuple(i * coefficient for i, coefficient in enumerate(coefficients))[1:]
    if len(slope) < 2:
        return []
    edges = [0.0, *_turning_points(slope, end), end]
    found: list[float] = []
    for low, high in pairwise(edges):
        at_low, at_high = value(slope, low), value(slope, high)
        if at_high == 0.0 or (at_low < 0.0) != (at_high < 0.0):
            found.append(_crossing(slope, low, high))
    return found


def _crossing(coefficients: Sequence[float], low: float, high: float) -> float:
    """The place where the sign at ``low`` ends, by bisection down to neighbouring floats."""
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
