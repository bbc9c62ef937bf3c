"""Series of slow quantities (positions, heights) with their rates, interpolated at any instant near them."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from itertools import pairwise
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, BootNs
from fwav_companion.geometry.vectors import Vector3

Values: TypeAlias = tuple[float, ...]

KEPT_NS = 5 * NS_PER_S
MOST_KEPT = 512
"""Most stored samples: 5 s at 50 Hz are 250. More than this is a flood, and the oldest are dropped."""
LONGEST_BRIDGE_NS = 2 * NS_PER_S
"""Longest interval between two samples, and beyond the newest, that is bridged; in a longer one values are unknown."""
UNMEASURED_ACCELERATION = 3.0
"""One sigma of the unmeasured acceleration between samples, m/s^2. A third of g: a small vehicle that banks at 17
degrees."""


class HermitePoint(msgspec.Struct, frozen=True, gc=False):
    """Interpolated values at one instant."""

    values: Values
    rates: Values
    """Reported rates of the values, per second. The slope of the curve would contain the noise of two values over their
    interval: 0.3 m of height noise at 10 Hz are 4 m/s."""
    sigma: float
    """One sigma of each value that interpolation or extrapolation adds."""


class HermiteSeries:
    """Samples in order of time, interpolated by a cubic Hermite polynomial, or a straight line beyond the newest."""

    __slots__ = ("_samples", "_splits", "_times")

    def __init__(self) -> None:
        self._times: list[BootNs] = []
        self._samples: list[tuple[Values, Values]] = []
        self._splits: set[BootNs] = set()

    def split_at(self, boot_ns: BootNs) -> None:
        """Stop interpolating between the sample of this instant and the one before it: the values jumped."""
        self._splits = {each for each in self._splits if self._times and each >= self._times[0]} | {boot_ns}

    def insert(self, boot_ns: BootNs, values: Values, rates: Values) -> None:
        """Store a sample, in any order. A second one of the same instant replaces the first."""
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
        self._splits.clear()

    @property
    def newest_ns(self) -> BootNs | None:
        """The instant of the latest sample."""
        return self._times[-1] if self._times else None

    def times_after(self, boot_ns: BootNs) -> list[BootNs]:
        """Instants of the samples later than this one, in order."""
        return self._times[bisect_right(self._times, boot_ns) :]

    def begins_piece(self, boot_ns: BootNs) -> bool:
        """Whether the values jumped at the sample of this instant."""
        return boot_ns in self._splits

    def at(self, boot_ns: BootNs) -> HermitePoint | None:
        """Values at the instant; None where no sample is near."""
        index = bisect_right(self._times, boot_ns)
        if index == 0:
            return None
        if index == len(self._times):
            return self._beyond(boot_ns)
        return self._between(index - 1, boot_ns)

    def way_between(self, start_ns: BootNs, end_ns: BootNs) -> Vector3 | None:
        """Change of the first three values from one instant to a later one, by the integral of their reported rates
        alone; None where they are not known. A jump of the values is no change of what they measure.
        """
        first, last = self.at(start_ns), self.at(end_ns)
        if first is None or last is None:
            return None
        inner = slice(bisect_right(self._times, start_ns), bisect_left(self._times, end_ns))
        times = [start_ns, *self._times[inner], end_ns]
        rates = [first.rates, *(rates for _, rates in self._samples[inner]), last.rates]
        north = east = down = 0.0
        for (t0, r0), (t1, r1) in pairwise(zip(times, rates, strict=True)):
            half_s = 0.5e-9 * (t1 - t0)
            north, east, down = (
                north + half_s * (r0[0] + r1[0]), east + half_s * (r0[1] + r1[1]), down + half_s * (r0[2] + r1[2])
            )  # fmt: skip
        return north, east, down

    def _beyond(self, boot_ns: BootNs, last: int = -1) -> HermitePoint | None:
        """The values from one sample alone, the newest or the last before a jump."""
        age_ns = boot_ns - self._times[last]
        if age_ns > LONGEST_BRIDGE_NS:
            return None
        age_s = age_ns * 1e-9
        values, rates = self._samples[last]
        moved = tuple([v + r * age_s for v, r in zip(values, rates, strict=True)])
        return HermitePoint(moved, rates, 0.5 * UNMEASURED_ACCELERATION * age_s * age_s)

    def _between(self, index: int, boot_ns: BootNs) -> HermitePoint | None:
        start_ns, end_ns = self._times[index], self._times[index + 1]
        if self._splits and end_ns in self._splits:
            return self._beyond(boot_ns, index)
        if end_ns - start_ns > LONGEST_BRIDGE_NS:
            return None
        step_s = (end_ns - start_ns) * 1e-9
        s = (boot_ns - start_ns) / (end_ns - start_ns)
        (a, da), (b, db) = self._samples[index], self._samples[index + 1]
        values, rates, t, between = [], [], 1.0 - s, s * (1.0 - s)
        for v0, r0, v1, r1 in zip(a, da, b, db, strict=True):
            chord = v1 - v0
            # The chord, plus the departure of each end's slope from it, which fades toward the other end.
            values.append(v0 + s * chord + between * ((r0 * step_s - chord) * t + (chord - r1 * step_s) * s))
            rates.append(r0 + s * (r1 - r0))
        # Error of a cubic Hermite under an acceleration that differs by this from the samples' own.
        sigma = UNMEASURED_ACCELERATION * step_s * step_s * between * between
        return HermitePoint(tuple(values), tuple(rates), sigma)


class RecentValues:
    """The last 256 values of a quantity with their instants; a query returns the nearest."""

    __slots__ = ("_times", "_values")

    KEPT = 256
    """2.5 s of a rangefinder at 100 Hz: as late as a frame may be that steers a landing."""

    def __init__(self) -> None:
        self._times: list[BootNs] = []
        self._values: list[object] = []

    def insert(self, boot_ns: BootNs, value: object) -> None:
        """Store a value, in any order; the oldest of more than 256 is dropped."""
        index = bisect_right(self._times, boot_ns)
        self._times.insert(index, boot_ns)
        self._values.insert(index, value)
        if len(self._times) > self.KEPT:
            del self._times[0], self._values[0]

    def clear(self) -> None:
        """Forget everything."""
        self._times.clear()
        self._values.clear()

    def after(self, boot_ns: BootNs) -> list[object]:
        """The stored values later than this instant, in order of time."""
        return self._values[bisect_right(self._times, boot_ns) :]

    def near(self, boot_ns: BootNs, within_ns: int) -> object | None:
        """Value nearest to this instant, or None where none lies within ``within_ns``."""
        times = self._times
        index = bisect_right(times, boot_ns)
        if index == len(times) or (index and boot_ns - times[index - 1] < times[index] - boot_ns):
            index -= 1
        return self._values[index] if index >= 0 and abs(times[index] - boot_ns) <= within_ns else None
