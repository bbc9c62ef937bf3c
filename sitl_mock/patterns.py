"""Paths over the ground: position with its first three derivatives, relative to the flight centre."""

from __future__ import annotations

from math import cos, hypot, pi, sin
from typing import NamedTuple

from sitl_mock.options import FlightOptions
from sitl_mock.waypoints import Waypoints

Pair = tuple[float, float]


class Path(NamedTuple):
    """North and east: position, velocity, acceleration and jerk (the rates of heading and bank need the last two)."""

    at: Pair
    velocity: Pair
    acceleration: Pair
    jerk: Pair
    up: Pair | None = None
    """Height above the ground and its rate, where the pattern defines them."""
    heading_deg: Pair | None = None
    """Heading and its rate, where the pattern defines them."""
    tilt: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """Roll, its rate, pitch and its rate by which the vehicle makes its accelerations, radians."""


class Pattern:
    """north = a sin(s), east = b sin(m s + phase); s grows linearly at the rate that gives the configured mean
    speed.
    """

    def __init__(self, options: FlightOptions) -> None:
        self._a, self._b = options.half_axes_m
        self._drift = options.drift_m_s
        self._phase = options.start_phase_deg * pi / 180.0
        self._still: Path | None = None
        self._waypoints = Waypoints(options.waypoints) if options.pattern == "waypoints" else None
        # (multiple of s, phase) of east: an ellipse leads by a quarter turn, a figure eight has twice the frequency.
        self._m, self._east_phase = {"figure_eight": (2.0, 0.0)}.get(options.pattern, (1.0, pi / 2.0))
        if options.pattern in ("hover", "hand"):
            self._still = Path(options.offset_m, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
        elif options.pattern not in ("orbit", "figure_eight", "racetrack", "waypoints"):
            raise KeyError(f"no pattern {options.pattern!r}: hover, orbit, figure_eight, racetrack, hand or waypoints")
        w = options.speed_m_s * 2.0 * pi / self._length()
        v = w * self._m
        self._north_rates, self._east_rates = ((rate, -rate * rate, -(rate**3)) for rate in (w, v))

    def at(self, flight_s: float) -> Path:
        """Path at an instant."""
        path = self._about_centre(flight_s)
        if self._drift == (0.0, 0.0):
            return path
        (n, e), (vn, ve), (to_n, to_e) = path.at, path.velocity, self._drift
        return path._replace(at=(n + to_n * flight_s, e + to_e * flight_s), velocity=(vn + to_n, ve + to_e))

    def _about_centre(self, flight_s: float) -> Path:
        if self._waypoints is not None:
            north, east, up, heading = self._waypoints.at(flight_s)
            at, velocity, acceleration, jerk = zip(north, east, strict=True)
            return Path(at, velocity, acceleration, jerk, up[:2], heading[:2])
        if self._still is not None:
            return self._still
        w, north_acceleration, north_jerk = self._north_rates
        v, east_acceleration, east_jerk = self._east_rates
        s = self._phase + w * flight_s
        sn, cn = self._a * sin(s), self._a * cos(s)
        angle = self._m * s + self._east_phase
        se, ce = self._b * sin(angle), self._b * cos(angle)
        return Path(
            (sn, se),
            (w * cn, v * ce),
            (north_acceleration * sn, east_acceleration * se),
            (north_jerk * cn, east_jerk * ce),
        )

    def _length(self) -> float:
        steps = 2000
        step = 2.0 * pi / steps
        return sum(
            hypot(self._a * cos(i * step), self._b * self._m * cos(self._m * i * step + self._east_phase)) * step
            for i in range(steps)
        )
