"""Covariances in messages, and the 95 % ellipse and circle that the picture shows. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isfinite, log, sqrt

from fwav_companion.geometry.ellipses import semi_axes
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.ground.views import EllipseView

SCALE_95 = sqrt(-2.0 * log(0.05))
"""Semi-axes of the 95 % ellipse over those of one sigma: chi-square quantile with 2 degrees of freedom."""


def from_triangle(values: Sequence[float]) -> Matrix3 | None:
    """The symmetric matrix of an upper triangle; None where it is not a covariance of finite numbers."""
    if len(values) != 6 or not all(isfinite(value) for value in values):
        return None
    nn, ne, nd, ee, ed, dd = values
    if nn < 0.0 or ee < 0.0 or dd < 0.0 or ne * ne > nn * ee * 1.02:  # three digits round
        return None
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


def ellipse_of(cov: Matrix3) -> EllipseView:
    """The horizontal 95 % ellipse."""
    larger, smaller, bearing = semi_axes(cov)
    return EllipseView(SCALE_95 * larger, SCALE_95 * smaller, degrees(bearing) % 180.0)
