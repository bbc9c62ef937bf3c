"""Projections onto a sphere first: unified (omni), double sphere, extended unified, and OCamCalib's polynomial. PURE.

Each maps the angle theta from the optical axis to the radius m on a plane at distance 1, before the plane's distortion:

    unified          m = sin theta / (cos theta + xi)                                   Mei & Rives 2007
    double sphere    m = sin theta / (a d + (1 - a)(xi + cos theta)),   d^2 = 1 + 2 xi cos theta + xi^2    Usenko 2018
    extended         m = sin theta / (a d + (1 - a) cos theta),   d^2 = b sin^2 theta + cos^2 theta      Khomutenko 2016
    OCamCalib        theta = atan2(m, p(m)),   p(m) = 1 + c2 m^2 + c3 m^3 + ...         Scaramuzza 2006, p(0) = 1
"""

from __future__ import annotations

from math import atan2, cos, inf, pi, sin, sqrt
from typing import Final, Protocol

import msgspec

LEAST_SLOPE: Final = 1e-6
"""Ratio of dm/dtheta to its value on the axis at which the valid range ends: rounding of a pixel then moves the ray."""
STEPS: Final = 720
"""The search for the end of the valid range tests every quarter degree."""
MOST_NEWTON: Final = 100


class SphereModel(Protocol):
    """The radius on the plane by the angle from the axis, and the angle by the radius."""

    def radius_and_slope(self, theta: float) -> tuple[float, float]:
        """The radius m(theta) and its slope dm/dtheta; a slope of 0 where the model ends."""

    def angle(self, radius: float, largest: float) -> float:
        """The angle in [0, largest] with this radius; m rises up to ``largest``."""


def valid_angle(model: SphereModel) -> float:
    """The largest angle up to which the radius rises, radians."""
    _, on_axis = model.radius_and_slope(0.0)

    def rises(theta: float) -> bool:
        return model.radius_and_slope(theta)[1] > LEAST_SLOPE * on_axis

    low = 0.0
    for i in range(1, STEPS):
        high = pi * i / STEPS
        if not rises(high):
            break
        low = high
    else:
        return low
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rises(middle) else (low, middle)
    return low


class _Quotient(msgspec.Struct, frozen=True):
    """A model m = sin theta / D(theta)."""

    def denominator(self, theta: float) -> tuple[float, float]:
        """D and dD/dtheta."""
        raise NotImplementedError

    def radius_and_slope(self, theta: float) -> tuple[float, float]:
        """As SphereModel."""
        d, slope = self.denominator(theta)
        if d <= 0.0:
            return inf, 0.0
        return sin(theta) / d, (cos(theta) * d - sin(theta) * slope) / (d * d)

    def angle(self, radius: float, largest: float) -> float:
        """As SphereModel, by Newton inside a bracket."""
        low, high = 0.0, largest
        theta = min(2.0 * atan2(radius, 2.0), largest)
        for _ in range(MOST_NEWTON):
            m, slope = self.radius_and_slope(theta)
            if m > radius:
                high = theta
            else:
                low = theta
            following = theta - (m - radius) / slope if slope > 0.0 else low
            if not low < following < high:
                following = 0.5 * (low + high)
            if abs(following - theta) <= 1e-16 * theta or not low < following < high:
                return following
            theta = following
        return theta


class Unified(_Quotient, frozen=True):
    """The unified model of Mei and Rives, Kalibr's omni."""

    xi: float

    def denominator(self, theta: float) -> tuple[float, float]:
        """D and dD/dtheta."""
        return cos(theta) + self.xi, -sin(theta)


class DoubleSphere(_Quotient, frozen=True):
    """The double sphere model of Usenko et al."""

    xi: float
    alpha: float

    def denominator(self, theta: float) -> tuple[float, float]:
        """D and dD/dtheta."""
        xi, a, c, s = self.xi, self.alpha, cos(theta), sin(theta)
        d = sqrt(1.0 + 2.0 * xi * c + xi * xi)
        return a * d + (1.0 - a) * (xi + c), -s * (a * xi / d + (1.0 - a)) if d > 0.0 else 0.0


class ExtendedUnified(_Quotient, frozen=True):
    """The extended unified model of Khomutenko et al."""

    alpha: float
    beta: float

    def denominator(self, theta: float) -> tuple[float, float]:
        """D and dD/dtheta."""
        a, b, c, s = self.alpha, self.beta, cos(theta), sin(theta)
        d = sqrt(b * s * s + c * c)
        return a * d + (1.0 - a) * c, a * (b - 1.0) * s * c / d - (1.0 - a) * s


class RayPolynomial(msgspec.Struct, frozen=True):
    """OCamCalib's polynomial p(m), the forward component of a ray by its radius; p(0) = 1."""

    coefficients: tuple[float, ...]
    """Of m^1, m^2, ..."""

    def _forward(self, m: float) -> tuple[float, float]:
        """The value p(m) and its slope."""
        p, slope = 0.0, 0.0
        for coefficient in reversed((1.0, *self.coefficients)):
            p, slope = p * m + coefficient, slope * m + p
        return p, slope

    def angle(self, radius: float, largest: float) -> float:
        """As SphereModel: the model's own direction."""
        return min(largest, atan2(radius, self._forward(radius)[0]))

    def radius_and_slope(self, theta: float) -> tuple[float, float]:
        """As SphereModel: the least m with m cos theta = p(m) sin theta, by bisection and Newton."""
        c, s = cos(theta), sin(theta)
        low, high = 0.0, 0.5
        while True:
            p, _ = self._forward(high)
            if high * c - p * s > 0.0:
                break
            low, high = high, 1.25 * high
            if high > 1e4:
                return inf, 0.0
        m = 0.5 * (low + high)
        for _ in range(MOST_NEWTON):
            p, slope = self._forward(m)
            miss = m * c - p * s
            low, high = (low, m) if miss > 0.0 else (m, high)
            rise = c - slope * s
            following = m - miss / rise if rise > 0.0 else low
            if not low < following < high:
                following = 0.5 * (low + high)
            if abs(following - m) <= 1e-16 * m or not low < following < high:
                break
            m = following
        p, slope = self._forward(m)
        # theta = atan2(m, p): dtheta/dm = (p - m p') / (m^2 + p^2)
        rise = p - m * slope
        return m, (m * m + p * p) / rise if rise > 0.0 else 0.0
