"""Probability circles of a horizontal covariance, exact for every ellipse."""

from __future__ import annotations

from math import atan2, cos, exp, isfinite, log, nan, pi, sin, sqrt

from fwav_companion.geometry.vectors import Matrix3

ANGLES = 48
"""Directions in a quarter turn over which the probability is averaged: exact to 1e-6 for axes of 1 to 100."""
HALVINGS = 60
"""Bisections of the radius: to rounding error."""
NORMAL_95 = 1.96
"""Half width of the 95 % interval of one normal variable, in sigmas."""
ELLIPSE_95 = 2.4477
"""Semi-axis of the 95 % ellipse of two normal variables in sigmas: the root of -2 ln 0.05."""
RADII_95 = (1.9600, 1.9625, 1.9704, 1.9842, 2.0051, 2.0359, 2.0813, 2.1460, 2.2303, 2.3318, 2.4477)
"""Radius of the 95 % circle over the larger semi-axis, for ratios of the axes of 0, 0.1, ... 1 (:func:`circle_radius`).
Linear interpolation between them is within 0.12 %."""
OUTLINE_CORNERS = 48
"""Corners of an ellipse's polygon: not visible at any zoom of a map."""


def semi_axes(cov: Matrix3) -> tuple[float, float, float]:
    """(larger, smaller, bearing of the larger from north) of the one-sigma horizontal ellipse, metres and radians."""
    nn, ne, ee = cov[0][0], cov[0][1], cov[1][1]
    mean, half = 0.5 * (nn + ee), 0.5 * (nn - ee)
    reach = sqrt(half * half + ne * ne)
    return sqrt(max(0.0, mean + reach)), sqrt(max(0.0, mean - reach)), 0.5 * atan2(2.0 * ne, nn - ee)


def ellipse_outline(north: float, east: float, cov: Matrix3, share: float) -> list[tuple[float, float]]:
    """(north, east) of the corners of the ellipse that holds the target with this probability, clockwise, open.

    Semi-axes: sqrt(-2 ln(1 - share)) sigmas, the chi-square quantile with 2 degrees of freedom.
    """
    larger, smaller, bearing = semi_axes(cov)
    scale = sqrt(-2.0 * log(1.0 - share))
    corners = []
    for corner in range(OUTLINE_CORNERS):
        angle = 2.0 * pi * corner / OUTLINE_CORNERS
        along, across = scale * larger * cos(angle), scale * smaller * sin(angle)
        corners.append(
            (north + along * cos(bearing) - across * sin(bearing), east + along * sin(bearing) + across * cos(bearing))
        )
    return corners


def share_within(radius_m: float, larger_m: float, smaller_m: float) -> float:
    """The probability that a centred Gaussian with these one-sigma semi-axes lies within the radius.

    In whitened coordinates the direction is uniform and the length has a Rayleigh distribution. The probability is
    elementary for each direction; the result is its mean over all directions.
    """
    if larger_m <= 0.0:
        return 1.0
    total = 0.0
    for index in range(ANGLES):
        angle = 0.5 * pi * (index + 0.5) / ANGLES
        square = (larger_m * cos(angle)) ** 2 + (smaller_m * sin(angle)) ** 2
        total += exp(-0.5 * radius_m * radius_m / square)
    return 1.0 - total / ANGLES


def circle_radius(cov: Matrix3, share: float) -> float:
    """The radius of the circle about the estimate that holds the target with the probability ``share``, metres."""
    larger, smaller, _ = semi_axes(cov)
    low, high = 0.0, larger * sqrt(-2.0 * log(1.0 - share))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if share_within(middle, larger, smaller) < share else (low, middle)
    return high


def radius_95(cov: Matrix3) -> float:
    """Radius of the 95 % circle, metres, to 0.12 %; NaN where the covariance is not finite.

    For messages and texts in flight: :func:`circle_radius` is exact, and costs thousands of exponentials.
    """
    if not isfinite(cov[0][0] + cov[0][1] + cov[1][1]):
        return nan
    larger, smaller, _ = semi_axes(cov)
    if larger <= 0.0:
        return 0.0
    at = smaller / larger * (len(RADII_95) - 1)
    index = min(int(at), len(RADII_95) - 2)
    return larger * (RADII_95[index] + (at - index) * (RADII_95[index + 1] - RADII_95[index]))
