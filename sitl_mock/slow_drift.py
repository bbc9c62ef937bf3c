"""Slow drifts without direction: sway, wander and gusts."""

from __future__ import annotations

from math import cos, pi, sin
from random import Random


class SlowDrift:
    """Smooth drift without direction: three sines with incommensurate periods, RMS about ``size``."""

    def __init__(self, size: float, rng: Random) -> None:
        terms = [
            (size * share, 2.0 * pi / period, rng.uniform(0.0, 2.0 * pi))
            for share, period in ((1.0, 23.7), (0.8, 11.3), (0.6, 6.1))
        ]
        self._sizes = tuple(size for size, _, _ in terms)
        self._phases = tuple(number for _, w, phase in terms for number in (w, phase))
        self._rates = tuple(size * w for size, w, _ in terms)

    def at(self, t: float) -> tuple[float, float]:
        """(value, rate). Unrolled, because a gyro evaluates it two thousand times a second."""
        u, i, v, j, w, k = self._phases
        a, b, c = self._sizes
        d, e, f = self._rates
        x, y, z = u * t + i, v * t + j, w * t + k
        return a * sin(x) + b * sin(y) + c * sin(z), d * cos(x) + e * cos(y) + f * cos(z)

    def value(self, t: float) -> float:
        """Value alone: a picture does not depend on the rate."""
        u, i, v, j, w, k = self._phases
        a, b, c = self._sizes
        return a * sin(u * t + i) + b * sin(v * t + j) + c * sin(w * t + k)

    def rate(self, t: float) -> float:
        """Rate alone: the yaw itself does not matter to a gyro."""
        u, i, v, j, w, k = self._phases
        d, e, f = self._rates
        return d * cos(u * t + i) + e * cos(v * t + j) + f * cos(w * t + k)
