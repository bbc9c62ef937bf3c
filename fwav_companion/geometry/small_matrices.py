"""Rows, and symmetric 3x3 algebra, on plain tuples, as the filters need it."""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, hypot, inf, sqrt
from typing import TypeAlias

from fwav_companion.geometry.vectors import Matrix3, Vector3, scale, subtract

Row: TypeAlias = tuple[float, ...]

Symmetric2: TypeAlias = tuple[float, float, float]
"""nn, ne, ee of a symmetric 2x2 matrix."""


def inner(a: Row, b: Row) -> float:
    """The inner product of two rows, by polarization: lengths take a tenth of the time of a sum of products."""
    return 0.5 * (hypot(*a) ** 2 + hypot(*b) ** 2 - dist(a, b) ** 2)


def products(rows: Sequence[Row], a: Row, b: Row) -> tuple[Row, Row]:
    """The matrix of these rows times the columns a and b: ``inner`` of each row with them."""
    a2, b2, by_a, by_b = hypot(*a) ** 2, hypot(*b) ** 2, [], []
    for row in rows:
        row2 = hypot(*row) ** 2
        by_a.append(0.5 * (row2 + a2 - dist(row, a) ** 2))
        by_b.append(0.5 * (row2 + b2 - dist(row, b) ** 2))
    return tuple(by_a), tuple(by_b)


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


def plus_diagonal(rows: Sequence[Row], values: Sequence[float]) -> tuple[Row, ...]:
    """The square matrix of these rows + diag(values)."""
    return tuple(
        [(*row[:i], row[i] + value, *row[i + 1 :]) for i, (row, value) in enumerate(zip(rows, values, strict=True))]
    )


def diagonal(values: Sequence[float]) -> tuple[Row, ...]:
    """Diag(values)."""
    return plus_diagonal([(0.0,) * len(values)] * len(values), values)


def symmetric_inverse(m: Matrix3) -> Matrix3:
    """The inverse of a symmetric positive definite matrix, by cofactors; ZeroDivisionError where it is singular."""
    (a, b, c), (_, d, e), (_, _, f) = m
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    s = 1.0 / (a * aa + b * ab + c * ac)
    ad, ae, af = a * f - c * c, b * c - a * e, a * d - b * b
    return ((aa * s, ab * s, ac * s), (ab * s, ad * s, ae * s), (ac * s, ae * s, af * s))


def symmetrized(m: Matrix3) -> Matrix3:
    """(m + m^T) / 2."""
    (a, b, c), (d, e, f), (g, h, i) = m
    bd, cg, fh = 0.5 * (b + d), 0.5 * (c + g), 0.5 * (f + h)
    return ((a, bd, cg), (bd, e, fh), (cg, fh, i))


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
