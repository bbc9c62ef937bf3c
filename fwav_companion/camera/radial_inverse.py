"""The inverse of an odd radial polynomial, r(theta) = k1 theta + k2 theta^3 + ... + k5 theta^9.

A ray needs no angle, only sin(theta) / r and cos(theta), and both are smooth functions of r^2, also at the centre. So a
table of cubic pieces gives a ray without root, sine or iteration. Near a fold, where the inverse turns
steep, no polynomial is good enough: the table ends there, and what lies beyond is solved by safeguarded Newton.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin, sqrt
from typing import TypeAlias

import msgspec

from fwav_companion.camera.polynomials import value

Cubic: TypeAlias = tuple[float, float, float, float]
Piece: TypeAlias = tuple[float, float, float, float, float, float, float, float]
"""Four coefficients of sin(theta) / rho, then four of cos(theta); polynomials in rho^2."""

FEWEST_PIECES, MOST_PIECES = 256, 4096
"""The paper's lens needs the fewest, 100 kB and 2 ms; one that folds inside its image has the most, 1 MB and 30 ms."""
PIECE_TOLERANCE = 3e-13
"""Of a unit ray's components, radians: 3e-10 px on a lens of 1000 px a radian."""


class RayTable(msgspec.Struct, frozen=True):
    """Rays by radius."""

    unit: float
    """Millimetres of one unit of rho: a piece is one unit of rho^2 wide."""
    pieces: tuple[Piece, ...]
    """Piece i is good for i <= rho^2 < i + 1."""


def radius_and_slope(k: Sequence[float], theta: float) -> tuple[float, float]:
    """R(theta) and dr/dtheta."""
    k1, k2, k3, k4, k5 = k
    t = theta * theta
    return (
        theta * (k1 + t * (k2 + t * (k3 + t * (k4 + t * k5)))),
        k1 + t * (3.0 * k2 + t * (5.0 * k3 + t * (7.0 * k4 + t * 9.0 * k5))),
    )


def angle_from_radius(k: Sequence[float], radius: float, largest: float) -> float:
    """Theta in [0, largest] with r(theta) = radius, where r rises all the way: Newton, kept inside a bracket."""
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
    """As many pieces as it takes for all but the outermost sixteenth of the image's area to be good."""
    edge_radius, _ = radius_and_slope(k, largest)
    count = FEWEST_PIECES
    while True:
        unit = edge_radius / sqrt(count)
        pieces = _good_pieces(k, largest, unit, count)
        if len(pieces) >= count - count // 16 or count >= MOST_PIECES:
            return RayTable(unit, pieces)
        count *= 4


def _good_pieces(k: Sequence[float], largest: float, unit: float, count: int) -> tuple[Piece, ...]:
    pieces: list[Piece] = []
    s0, c0 = _at(k, 0.0, unit, largest)
    for i in range(count):
        s1, c1 = _at(k, i + 1.0, unit, largest)
        sine, cosine = _cubic(s0, s1, i), _cubic(c0, c1, i)
        s_middle, c_middle = _at(k, i + 0.5, unit, largest)
        if max(sqrt(i + 1.0) * _error(sine, s_middle, i + 0.5), _error(cosine, c_middle, i + 0.5)) > PIECE_TOLERANCE:
            break
        pieces.append((*sine, *cosine))
        s0, c0 = s1, c1
    return tuple(pieces)


_Jet: TypeAlias = tuple[float, float]
"""A value and its derivative by rho^2."""


def _at(k: Sequence[float], rho2: float, unit: float, largest: float) -> tuple[_Jet, _Jet]:
    """Sin(theta) / rho and cos(theta) with their derivatives."""
    rho = sqrt(rho2)
    if rho == 0.0:
        k1 = k[0] / unit
        return (1.0 / k1, -(k[1] / unit / k1 + 1.0 / 6.0) / k1**3), (1.0, -0.5 / k1**2)
    theta = angle_from_radius(k, rho * unit, largest)
    slope = radius_and_slope(k, theta)[1] / unit
    s, c = sin(theta) / rho, cos(theta)
    return (s, 0.5 * (c / slope - s) / rho2), (c, -0.5 * s / slope)


def _cubic(start: _Jet, end: _Jet, at: int) -> Cubic:
    """Hermite's, through both ends with both slopes; as a polynomial in rho^2 itself, not in its fraction."""
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
