"""Courses of slow things (positions, heights): values with their rates, asked for any instant near them."""

from __future__ import annotations

from bisect import bisect_right
from math import sqrt
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, BootNs

Values: TypeAlias = tuple[float, ...]

KEPT_NS = 5 * NS_PER_S
MOST_KEPT = 512
"""5 s at 50 Hz are 250; a sender that floods us is cut here."""
LONGEST_BRIDGE_NS = 2 * NS_PER_S
"""Between two samples, and from the newest on: beyond it a position is told to be unknown."""
UNTOLD_ACCELERATION = 3.0
"""m/s^2, one sigma: what the velocity does between samples. A third of g: a small vehicle that banks at 17 degrees."""


class HermitePoint(msgspec.Struct, frozen=True, gc=False):
    """A course at one instant."""

    values: Values
    rates: Values
    """Per second."""
    sigma: float
    """What interpolating or extrapolating adds, one sigma of each value."""


class HermiteSeries:
    """Samples in order of their instants; a cubic Hermite between two, straight on beyond the newest."""

    __slots__ = ("_samples", "_times")

    def __init__(self) -> None:
        self._times: list[BootNs] = []
        self._samples: list[tuple[Values, Values]] = []

    def insert(self, boot_ns: BootNs, values: Values, rates: Values) -> None:
        """A sample, in any order. A second one of the same instant replaces the first."""
        index = bisect_right(self._times, boot_ns)
        if index and self._times[index - 1] == boot_ns:
            self._samples[index - 1] = (values, rates)
            return
        self._times.insert(index, boot_ns)
        self._samples.insert(index, (values, rates))
        old = bisect_right(self._times, self._times[-1] - KEPT_NS)
        excess = max(old, len(self._times) - MOST_KEPT)
        if excess > 0:
            del self._times[:excess], self._samples[:excess]

    def clear(self) -> None:
        """Forget everything."""
        self._times.clear()
        self._samples.clear()

    @property
    def newest_ns(self) -> BootNs | None:
        """The instant of the latest sample."""
        return self._times[-1] if self._times else None

    def at(self, boot_ns: BootNs) -> HermitePoint | None:
        """The course there; None where it holds nothing near."""
        index = bisect_right(self._times, boot_ns)
        if index == 0:
            return None
        if index == len(self._times):
            return self._beyond(boot_ns)
        return self._between(index - 1, boot_ns)

    def _beyond(self, boot_ns: BootNs) -> HermitePoint | None:
        age_ns = boot_ns - self._times[-1]
        if age_ns > LONGEST_BRIDGE_NS:
            return None
        age_s = age_ns * 1e-9
        values, rates = self._samples[-1]
        moved = tuple(v + r * age_s for v, r in zip(values, rates, strict=True))
        return HermitePoint(moved, rates, 0.5 * UNTOLD_ACCELERATION * age_s * age_s)

    def _between(self, index: int, boot_ns: BootNs) -> HermitePoint | None:
        start_ns, end_ns = self._times[index], self._times[index + 1]
        if end_ns - start_ns > LONGEST_BRIDGE_NS:
            return None
        step_s = (end_ns - start_ns) * 1e-9
        s = (boot_ns - start_ns) / (end_ns - start_ns)
        (a, da), (b, db) = self._samples[index], self._samples[index + 1]
        values, rates = [], []
        for v0, r0, v1, r1 in zip(a, da, b, db, strict=True):
            slope = (v1 - v0) / step_s
            # Around the chord: the two end slopes' departures from it, each fading to the other end.
            p, q = (r0 - slope) * step_s, (slope - r1) * step_s
            values.append(v0 + s * (v1 - v0) + s * (1.0 - s) * (p * (1.0 - s) + q * s))
            rates.append(slope + ((1.0 - s) * (1.0 - 3.0 * s) * p + s * (2.0 - 3.0 * s) * q) / step_s)
        # The error of a cubic Hermite under an acceleration that differs by this from what the samples tell.
        sigma = UNTOLD_ACCELERATION * step_s * step_s / 2.0 * (s * (1.0 - s)) ** 2 * sqrt(4.0)
        return HermitePoint(tuple(values), tuple(rates), sigma)


class RecentValues:
    """The last few values of something, each with its instant; the nearest one is asked for."""

    __slots__ = ("_times", "_values")

    KEPT = 64

    def __init__(self) -> None:
        self._times: list[BootNs] = []
        self._values: list[object] = []

    def insert(self, boot_ns: BootNs, value: object) -> None:
        """A new value, in any order; the oldest of 64 goes."""
        index = bisect_right(self._times, boot_ns)
        self._times.insert(index, boot_ns)
        self._values.insert(index, value)
        if len(self._times) > self.KEPT:
            del self._times[0], self._values[0]

    def clear(self) -> None:
        """Forget everything."""
        self._times.clear()
        self._values.clear()

    def near(self, boot_ns: BootNs, within_ns: int) -> object | None:
        """The value nearest to this instant, or None."""
        times = self._times
        index = bisect_right(times, boot_ns)
        if index == len(times) or (index and boot_ns - times[index - 1] < times[index] - boot_ns):
            index -= 1
        return self._values[index] if index >= 0 and abs(times[index] - boot_ns) <= within_ns else None
