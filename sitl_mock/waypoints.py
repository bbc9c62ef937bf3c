"""A flight through waypoints: descents, hovering turns, climbs and survey lines, smooth where they join.

Between two waypoints each coordinate follows the minimum-jerk quintic (Flash & Hogan, 1985): velocity and acceleration
are zero at both ends, and the peak velocity is 1.875 times the mean.
"""

from __future__ import annotations

from bisect import bisect_right
from itertools import pairwise
from typing import NamedTuple

from sitl_mock.option_types import Waypoint

Curve = tuple[float, float, float, float]
"""A value and its first three derivatives."""
STILL = (0.0, 0.0, 0.0)


class Course(NamedTuple):
    """North and east from the flight centre and up from the ground, metres; heading, degrees."""

    north: Curve
    east: Curve
    up: Curve
    heading: Curve


class Waypoints:
    """Path through waypoints; the vehicle stays at the first one before its time, and at the last one after its
    time.
    """

    def __init__(self, waypoints: tuple[Waypoint, ...]) -> None:
        """Raises ValueError for fewer than two waypoints or times that do not increase."""
        times = [waypoint[0] for waypoint in waypoints]
        if len(times) < 2 or any(later <= earlier for earlier, later in pairwise(times)):
            raise ValueError(
                "flight.waypoints: expected two or more (at_s, north, east, up, heading_deg), in rising time"
            )
        self._times, self._waypoints = times, waypoints

    def at(self, flight_s: float) -> Course:
        """Course at an instant."""
        leg = min(max(bisect_right(self._times, flight_s), 1), len(self._times) - 1)
        (from_s, *start), (to_s, *end) = self._waypoints[leg - 1 : leg + 1]
        lasts_s = to_s - from_s
        share = min(1.0, max(0.0, (flight_s - from_s) / lasts_s))
        curves = [_minimum_jerk(a, b - a, share, lasts_s) for a, b in zip(start, end, strict=True)]
        return Course(*curves)


def _minimum_jerk(start: float, change: float, share: float, lasts_s: float) -> Curve:
    s, rate = share, 1.0 / lasts_s
    value = start + change * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
    if not 0.0 < s < 1.0:
        return (value, *STILL)
    velocity = change * rate * 30.0 * (s * (1.0 - s)) ** 2
    acceleration = change * rate**2 * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
    jerk = change * rate**3 * 60.0 * (1.0 - 6.0 * s + 6.0 * s * s)
    return (value, velocity, acceleration, jerk)
