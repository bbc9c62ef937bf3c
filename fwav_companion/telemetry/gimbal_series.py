"""A gimbal's last attitudes, interpolated at any instant of its clock, and the error of that. Pure."""

from __future__ import annotations

from bisect import bisect_right, insort
from itertools import pairwise
from math import exp, sqrt

import msgspec

from fwav_companion.geometry import rotations
from fwav_companion.geometry.rotations import difference, multiply
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S
from fwav_companion.geometry.vectors import ZERO3, Vector3, norm, scale
from fwav_companion.telemetry.gimbal_reading import GimbalAttitude
from fwav_companion.types import Reason

KEPT_NS = 4 * NS_PER_S
MOST_KEPT = 512
WIDEST_GAP_NS = NS_PER_S
"""Longest interval that is interpolated at the usual 5 Hz, five times the usual one: a few messages were lost."""
WIDEST_SPACINGS = 2.0
"""Longest interval that is interpolated in a slower stream, in its own mean intervals: one message was lost."""
LEAST_APART_NS = 4 * NS_PER_MS
"""Least time between two stored attitudes. Closer stamps in whole milliseconds determine no rate: they are the same
attitude over two links, or a flood."""
MOST_EXTRAPOLATION_NS = 300 * NS_PER_MS
"""Longest extrapolation, one interval and a half at 5 Hz: then the next attitude is missing."""
MOST_SPACINGS_BEYOND = 1.5
"""The same in the mean intervals of a slower stream, down to 1 Hz."""
SLOWEST_NS = NS_PER_S
"""Longest mean interval of a stream for which these limits grow."""
NEAR_NS = 250 * NS_PER_MS
STEADY = 0.1
"""One sigma of the rate of a gimbal that holds its camera still, rad/s. It applies to an attitude without neighbours,
as recorded around each photograph."""
UNCHECKED = 2.0
"""RMS angular acceleration before it was measured, rad/s^2: an operator's stick turns a gimbal by 100 degrees a second,
within a second."""
MEMORY_S = 3.0
CHECKS_TO_BEGIN = 3
UNEVEN = 2.5
"""Five attitudes whose longest interval exceeds the shortest by this factor are not used for checks."""
MOST_UNRESOLVED = 4.0
"""Largest factor on the interpolation error where the motion is faster than the samples. A sample left out at twice the
spacing errs by four times the error in the middle of an interval if the motion is smooth; if it is faster than the
samples, the error is the same at every spacing."""


class GimbalSeries:
    """The attitudes of the last seconds in order of their stamps, and the measured error between them."""

    def __init__(self) -> None:
        self.looks: list[GimbalAttitude] = []
        self._checks = 0
        self._bend2 = self._wide_bend2 = 0.0

    def clear(self) -> None:
        """Delete every attitude; the measured motion stays."""
        self.looks.clear()
        self._checks = 0

    @property
    def newest(self) -> GimbalAttitude | None:
        """The attitude with the latest stamp."""
        return self.looks[-1] if self.looks else None

    @property
    def interpolation_sigma(self) -> float:
        """One sigma of the attitude in the middle between two samples, rad."""
        return sqrt(self._bend2) / 8.0 * self._spacing_s() ** 2 * self._unresolved()

    @property
    def last_but_one(self) -> GimbalAttitude | None:
        """The attitude before the latest; None without one."""
        return self.looks[-2] if len(self.looks) >= 2 else None

    def insert(self, look: GimbalAttitude) -> None:
        """Insert an attitude by its stamp, and update the measured motion; one that is known is ignored."""
        if any(abs(known.stamp_ns - look.stamp_ns) < LEAST_APART_NS for known in self.looks):
            return
        insort(self.looks, look)
        oldest_ns = self.looks[-1].stamp_ns - KEPT_NS
        while self.looks[0].stamp_ns < oldest_ns or len(self.looks) > MOST_KEPT:
            del self.looks[0]
        if look is self.looks[-1] and len(self.looks) >= 5:
            self._check(self.looks[-5:])

    def _check(self, five: list[GimbalAttitude]) -> None:
        """Update the angular acceleration from samples left out at twice and at four times the spacing."""
        steps = [b.stamp_ns - a.stamp_ns for a, b in pairwise(five)]
        if len({look.from_north for look in five}) > 1 or max(steps) > min(UNEVEN * min(steps), self._widest_ns()):
            return
        self._checks += 1
        elapsed_s = (five[4].stamp_ns - five[3].stamp_ns) * 1e-9
        gain = max(1.0 / self._checks, 1.0 - exp(-elapsed_s / MEMORY_S))
        self._bend2 += gain * (_bend(five[2], five[3], five[4]) ** 2 - self._bend2)
        self._wide_bend2 += gain * (_bend(five[0], five[2], five[4]) ** 2 - self._wide_bend2)

    def _unresolved(self) -> float:
        """Factor by which the error in the middle of an interval exceeds that of a smooth course."""
        if self._checks < CHECKS_TO_BEGIN or self._wide_bend2 <= 0.0:
            return 1.0
        return max(1.0, min(MOST_UNRESOLVED, sqrt(self._bend2 / self._wide_bend2)))

    def _acceleration(self) -> float:
        """RMS angular acceleration, rad/s^2."""
        return (UNCHECKED if self._checks < CHECKS_TO_BEGIN else sqrt(self._bend2)) * self._unresolved()

    def _spacing_s(self) -> float:
        if len(self.looks) < 2:
            return 0.0
        return (self.looks[-1].stamp_ns - self.looks[0].stamp_ns) * 1e-9 / (len(self.looks) - 1)

    def _slow_spacing_ns(self) -> float:
        """Mean interval of a slow stream, at most SLOWEST_NS."""
        return min(self._spacing_s() * NS_PER_S, SLOWEST_NS)

    def _widest_ns(self) -> float:
        return max(WIDEST_GAP_NS, WIDEST_SPACINGS * self._slow_spacing_ns())

    def at(self, stamp_ns: int) -> tuple[GimbalAttitude, Vector3, float, float] | Reason:
        """(attitude, rates, sigma, gap) at a stamp, as the messages report it; or the reason why it is not known. Far
        from other attitudes, the nearest one is used.
        """
        between = self.between(stamp_ns)
        if not isinstance(between, Reason):
            return between
        nearest = min(self.looks, key=lambda look: abs(look.stamp_ns - stamp_ns))
        gap_ns = abs(nearest.stamp_ns - stamp_ns)
        if gap_ns > NEAR_NS:
            return between
        gap_s = gap_ns * 1e-9
        return nearest, ZERO3, STEADY * gap_s, gap_s

    def between(self, stamp_ns: int) -> tuple[GimbalAttitude, Vector3, float, float] | Reason:
        """(attitude, rates, sigma, gap) between two messages, or shortly after the last one."""
        looks = self.looks
        index = bisect_right(looks, stamp_ns, key=lambda look: look.stamp_ns)
        if index == 0:
            return Reason.NO_GIMBAL
        beyond = index == len(looks)
        if beyond:
            longest_ns = max(MOST_EXTRAPOLATION_NS, MOST_SPACINGS_BEYOND * self._slow_spacing_ns())
            if stamp_ns - looks[-1].stamp_ns > longest_ns:
                return Reason.STALE_GIMBAL
            index -= 1
        if index == 0:
            return Reason.NO_GIMBAL
        first, last = looks[index - 1], looks[index]
        span_ns, since_s = last.stamp_ns - first.stamp_ns, (stamp_ns - first.stamp_ns) * 1e-9
        if span_ns > self._widest_ns() or (first.from_north, first.locked) != (last.from_north, last.locked):
            return Reason.NO_GIMBAL
        rates = scale(difference(last.q, first.q), NS_PER_S / span_ns)
        q = multiply(first.q, rotations.exp(scale(rates, since_s)))
        until_s = (last.stamp_ns - stamp_ns) * 1e-9
        sigma = 0.5 * self._acceleration() * since_s * abs(until_s)
        gap_s = abs(until_s) if beyond else min(since_s, until_s)
        return msgspec.structs.replace(first, q=q), rates, sigma, gap_s


def _bend(first: GimbalAttitude, middle: GimbalAttitude, last: GimbalAttitude) -> float:
    """Angular acceleration, rad/s^2, that would explain the middle attitude's deviation from a constant rate."""
    before_s, after_s = (middle.stamp_ns - first.stamp_ns) * 1e-9, (last.stamp_ns - middle.stamp_ns) * 1e-9
    turn = scale(difference(last.q, first.q), before_s / (before_s + after_s))
    off = norm(difference(middle.q, multiply(first.q, rotations.exp(turn))))
    return 2.0 * off / (before_s * after_s)
