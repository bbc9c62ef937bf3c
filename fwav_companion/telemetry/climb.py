"""The vertical velocity of the vehicle's path, without the heave of a flapping wing.

A body that heaves by 2 cm at 9.7 Hz moves up and down at up to 1.2 m/s. Positions at 10 Hz sample it at nearly the same
phase of each beat, so the reported vertical velocities look like a climb that changes its sign every 1.7 s (aliasing).
Integrated, they move the path by half a metre, but the reported heights show only the 2 cm. So velocities whose
integral the heights contradict are replaced by the slope of the heights.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp
from statistics import linear_regression

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, BootNs, s_from_ns

COMPARED_NS = 750 * NS_PER_MS
"""Interval over which velocities are compared with heights: half a period of the alias of a beat 0.7 Hz from the rate
of positions. The alias of a beat farther from that rate moves an integral by less than 0.3 m."""
SLOPE_NS = 3 * NS_PER_S
"""Time of the heights whose slope is taken: 0.3 m of noise at 10 Hz leaves 0.06 m/s."""
MEMORY_S = 10.0
"""Time constant of the mean squares."""
LEAST_DRIFT_M = 0.3
"""Least root mean square of the drift of the integral from the heights over COMPARED_NS, beyond noise, that contradicts
the velocities: 0.4 m/s. In ArduCopter's simulator it is 0.05 m, in PX4's, whose altitude moves by 0.5 m, 0.17."""
NOISE_FACTOR = 1.6
"""Bound of the mean square of the drift over that of the noise. By noise alone none of 200 flights exceeded it."""
LEAST_COMPARED = 50
"""Comparisons before a verdict: 5 s at 10 Hz, in which the estimates of an autopilot settle that has just started."""
HELD_NS = 20 * NS_PER_S
"""Time after a contradiction during which velocities are not used: the alias of a beat 0.01 Hz from the rate of
positions is below 0.4 m/s for 10 s before it grows again with the other sign."""
MOST_JUMP_M = 2.0
"""Change of the offset within one interval from which the comparison starts again: the home was moved."""
MOST_DRIFT2_M2 = 1.0
"""Largest square of a drift: a smaller jump than that, which counts for COMPARED_NS, contradicts nothing alone."""
LONGEST_GAP_NS = NS_PER_S
"""Interval of two positions from which the comparison starts again."""
MOST_KEPT = 256
"""3 s at 50 Hz are 150 positions. More than this is a flood, and the oldest are dropped."""


class PathPoint(msgspec.Struct, frozen=True, gc=False):
    """One reported position."""

    boot_ns: BootNs
    height_m: float
    climb_m_s: float
    """As reported."""
    offset_m: float
    """Height without the integral of the climb rates: constant but for noise where both agree."""


class ClimbCheck:
    """Compares reported vertical velocities with reported heights."""

    __slots__ = ("_compared", "_contradicted_ns", "_drift2", "_noise2", "_points")

    def __init__(self) -> None:
        self._points: list[PathPoint] = []
        """The positions of the last SLOPE_NS."""
        self._noise2 = self._drift2 = 0.0
        """Mean squares of the change of the offset over one interval, and over COMPARED_NS, m^2."""
        self._compared = 0
        """Number of comparisons."""
        self._contradicted_ns: BootNs | None = None
        """Instant of the last contradiction."""

    def climb_at(self, boot_ns: BootNs, height_m: float, reported_m_s: float) -> float:
        """The climb rate of the path at a new position, m/s: as reported, or the slope of the heights."""
        points = self._points
        if not points or not 0 < boot_ns - points[-1].boot_ns <= LONGEST_GAP_NS:
            self._points, self._compared = [PathPoint(boot_ns, height_m, reported_m_s, 0.0)], 0
            return reported_m_s
        last = points[-1]
        step_s = 1e-9 * (boot_ns - last.boot_ns)
        change_m = height_m - last.height_m - 0.5 * (last.climb_m_s + reported_m_s) * step_s
        now = PathPoint(boot_ns, height_m, reported_m_s, last.offset_m + change_m)
        if abs(change_m) > MOST_JUMP_M:
            points.clear()
        points.append(now)
        while boot_ns - points[0].boot_ns > SLOPE_NS or len(points) > MOST_KEPT:
            del points[0]
        for before in reversed(points):
            if boot_ns - before.boot_ns >= COMPARED_NS:
                self._compare(now, change_m, step_s, now.offset_m - before.offset_m)
                at_ns = self._contradicted_ns
                return reported_m_s if at_ns is None or boot_ns - at_ns > HELD_NS else _slope_m_s(points)
        return reported_m_s

    def _compare(self, now: PathPoint, change_m: float, step_s: float, drift_m: float) -> None:
        """Take one change of the offset over one interval, and one over COMPARED_NS."""
        self._compared += 1
        share = max(1.0 - exp(-step_s / MEMORY_S), 1.0 / self._compared)
        self._noise2 += share * (change_m**2 - self._noise2)
        self._drift2 += share * (min(MOST_DRIFT2_M2, drift_m**2) - self._drift2)
        drifts = self._drift2 > LEAST_DRIFT_M**2 + NOISE_FACTOR * self._noise2
        if drifts and self._compared >= LEAST_COMPARED:
            self._contradicted_ns = now.boot_ns


def _slope_m_s(points: Sequence[PathPoint]) -> float:
    """Least-squares slope of the heights."""
    times_s = [s_from_ns(point.boot_ns - points[0].boot_ns) for point in points]
    return linear_regression(times_s, [point.height_m for point in points]).slope
