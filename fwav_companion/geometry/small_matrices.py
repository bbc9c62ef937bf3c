"""Rows, and symmetric 3x3 algebra, on plain tuples, as the filters need it."""

from __future__ import annotations

from math import dist, hypot, inf, sqrt
from typing import TypeAlias

from fwav_companion.geometry.vectors import Matrix3, Vector3, scale, subtract

Row: TypeAlias = tuple[float, ...]

Symmetric2: TypeAlias = tuple[float, float, float]
"""nn, ne, ee of a symmetric 2x2 matrix."""


def inner(a: Row, b: Row) -> float:
    """The inner product of two rows, by polarization: lengths take a tenth of the time of a sum of products."""
    return 0.5 * (hypot(*a) ** 2 + hypot(*b) ** 2 - dist(a, b) ** 2)


def gram(n: Row, e: Row) -> Symmetric2:
    """The inner products nn, ne, ee of two rows."""
    nn, ee = hypot(*n) ** 2, hypot(*e) ** 2
    return (nn, 0.5 * (nn + ee - dist(n, e) ** 2), ee)


def squared_distance(north: float, east: float, cov: Symmetric2) -> float:
    """Squared Mahalanobis distance, 2 degrees of freedom; infinite where the covariance has no extent."""
    nn, ne, ee = cov
    determinant = nn * ee - ne * ne
    if not determinant > 0.0:
        return inf
    return (ee * north * north - 2.0 * ne * north * east + nn * east * east) / determinant


def horizontal_sigma(cov: Matrix3) -> float:
    """Square root of the trace of the horizontal covariance, metres."""
    return sqrt(max(0.0, cov[0][0] + cov[1][1]))


def add_diagonal(m: Matrix3, horizontal: float, down: float) -> Matrix3:
    """M + diag(horizontal, horizontal, down)."""
    (a, b, c), (d, e, f), (g, h, i) = m
    return ((a + horizontal, b, c), (d, e + horizontal, f), (g, h, i + down))


def add_outer(m: Matrix3, variance: float, column: Vector3) -> Matrix3:
    """M + variance column column', for a symmetric m."""
    (nn, ne, nd), (_, ee, ed), (_, _, dd) = m
    n, e, d = column
    by_n, by_e = variance * n, variance * e
    nn, ne, nd = nn + by_n * n, ne + by_n * e, nd + by_n * d
    ee, ed, dd = ee + by_e * e, ed + by_e * d, dd + variance * d * d
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


def scaled(m: Matrix3, s: float) -> Matrix3:
    """S m."""
    return (scale(m[0], s), scale(m[1], s), scale(m[2], s))


def minus(a: Matrix3, b: Matrix3) -> Matrix3:
    """A - b."""
    return (subtract(a[0], b[0]), subtract(a[1], b[1]), subtract(a[2], b[2]))
