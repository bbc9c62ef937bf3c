"""The vehicle's angular motion as its attitudes show it: rate, acceleration, frequency and amplitude. PURE."""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, pi, sqrt

from fwav_companion.geometry.vectors import dot, scale, subtract
from fwav_companion.telemetry.attitude.interpolation import aligned
from fwav_companion.telemetry.attitude.rate_fit import ALTERNATING, RateFit
from fwav_companion.types import AttitudeSample

MOST_SWING = 0.5
"""Amplitude assumed where nothing better is known, and upper limit of the measured one, rad."""


class AngularMotion:
    """Running means of the angular motion over neighbouring samples; the caller chooses the averaging gain."""

    __slots__ = ("_acceleration2", "_bend2", "_rates", "_unbent2", "rate2", "spacing_s", "swing")

    def __init__(self, rates: RateFit) -> None:
        self._rates = rates
        self.spacing_s = 0.0
        """Mean seconds between samples."""
        self.rate2 = 0.0
        """Mean square of the angular rate, rad^2/s^2."""
        self.swing = MOST_SWING
        """RMS amplitude of the motion about its mean, rad."""
        self._acceleration2 = self._bend2 = self._unbent2 = 0.0

    @property
    def angular_acceleration(self) -> float:
        """RMS angular acceleration, rad/s^2."""
        return sqrt(self._acceleration2)

    @property
    def alternates(self) -> bool:
        """Whether half a period of the motion lies between two attitudes: its phase is then unknown."""
        return self._unbent2 > ALTERNATING * self._bend2 or self._rates.alternates

    @property
    def frequency(self) -> float:
        """Angular frequency of the motion, rad/s: RMS acceleration over RMS rate; where samples alternate, a lower
        bound.
        """
        if self.alternates:
            return pi / self.spacing_s
        return self.shown_frequency

    @property
    def shown_frequency(self) -> float:
        """Angular frequency that the samples show, rad/s: RMS acceleration over RMS rate."""
        return sqrt(self._acceleration2 / self.rate2) if self.rate2 > 1e-12 else 0.0

    def measure(self, three: Sequence[AttitudeSample], gain: float) -> None:
        """Update the motion from three attitudes' differences or from their sent rates, whichever show more of it."""
        before, middle, after = three
        h = 0.5e-9 * (after.boot_ns - before.boot_ns)
        first, amid, last = aligned([sample.ned_from_body for sample in three])
        halfway = [0.5 * (a + b) for a, b in zip(first, last, strict=True)]
        bend, drift = 2.0 * dist(halfway, amid), dist(first, last)
        sent = scale(subtract(after.rates, before.rates), 0.5 / h)
        self.spacing_s += gain * (h - self.spacing_s)
        self._acceleration2 += gain * (max(4.0 * bend**2 / h**4, dot(sent, sent)) - self._acceleration2)
        self.rate2 += gain * (max(drift**2 / h**2, dot(middle.rates, middle.rates)) - self.rate2)
        self.swing = self._amplitude()

    def measure_alternation(self, four: Sequence[AttitudeSample], gain: float) -> None:
        """Update the measure of alternation: whether each second difference of the attitudes undoes the previous one.
        Second differences of noise undo two thirds.
        """
        a, b, c, d = aligned([sample.ned_from_body for sample in four])
        bends = [(p - 2.0 * q + r, q - 2.0 * r + s) for p, q, r, s in zip(a, b, c, d, strict=True)]
        self._bend2 += gain * (0.5 * sum(one * one + two * two for one, two in bends) - self._bend2)
        self._unbent2 += gain * (-sum(one * two for one, two in bends) - self._unbent2)
        self.swing = self._amplitude()

    def _amplitude(self) -> float:
        if self.alternates:  # attitudes and rates then show the sine and the cosine of the motion at the samples
            peak2 = 0.25 * self._bend2 + self.rate2 / self.frequency**2
            return min(MOST_SWING, sqrt(0.5 * peak2))
        if self._acceleration2 <= 1e-12:
            return MOST_SWING
        return min(MOST_SWING, self.rate2 / sqrt(self._acceleration2))
