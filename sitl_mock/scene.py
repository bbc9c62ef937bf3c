"""Targets on the ground, fixed and walking."""

from __future__ import annotations

from math import cos, pi, radians, sin

from sitl_mock.options import Options
from sitl_mock.rotation import Vector
from sitl_mock.surface import Surface
from sitl_mock.target_options import HEAVE_S, TargetOptions

CORNERS: tuple[Vector, ...] = tuple((x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0))
"""Corners of a block in shares of its width, width and height, from the middle of its base."""


class Target:
    """A target on the ground, in the world's NED."""

    def __init__(self, options: TargetOptions, centre: tuple[float, float], surface: Surface) -> None:
        self.label = options.label
        self.walks = options.speed_m_s != 0.0 or options.heave_m != 0.0
        self._heave_m = options.heave_m
        north, east = centre[0] + options.north, centre[1] + options.east
        self._surface, self._up = surface, options.up
        self._start = (north, east, -options.up - surface.height_m(north, east))
        self._leg_m = options.leg_m
        self.height_m, self._width_m = options.height_m, options.width_m
        course = radians(options.course_deg)
        self._velocity = (options.speed_m_s * cos(course), options.speed_m_s * sin(course))
        self.tags = options.tags
        self._heading, self._turn = radians(options.heading_deg), radians(options.turn_deg_s)

    def at(self, flight_s: float) -> Vector:
        """Position at an instant, NED, metres."""
        if not self.walks:
            return self._start
        t = self._walked_s(flight_s)
        north, east = self._start[0] + self._velocity[0] * t, self._start[1] + self._velocity[1] * t
        heave_m = self._heave_m * sin(2.0 * pi * flight_s / HEAVE_S)
        return (north, east, -self._up - heave_m - self._surface.height_m(north, east))

    def corner_at(self, corner: Vector, flight_s: float) -> Vector:
        """A corner of a block, NED, metres."""
        (north, east, down), (x, y, z) = self.at(flight_s), corner
        return (north + x * self._width_m, east + y * self._width_m, down - z * self.height_m)

    def heading_at(self, flight_s: float) -> float:
        """Direction of a pad's forward axis, radians."""
        return self._heading + self._turn * flight_s

    def on_pad(self, forward_m: float, right_m: float, flight_s: float) -> Vector:
        """A point of a pad about its landing point, NED, metres."""
        north, east, down = self.at(flight_s)
        heading = self.heading_at(flight_s)
        c, s = cos(heading), sin(heading)
        return (north + forward_m * c - right_m * s, east + forward_m * s + right_m * c, down)

    def velocity_at(self, flight_s: float) -> tuple[float, float]:
        """Velocity at an instant: north and east, m/s."""
        back = self._leg_s > 0.0 and flight_s % (2.0 * self._leg_s) >= self._leg_s
        return (-self._velocity[0], -self._velocity[1]) if back else self._velocity

    @property
    def _leg_s(self) -> float:
        speed = (self._velocity[0] ** 2 + self._velocity[1] ** 2) ** 0.5
        return self._leg_m / speed if speed else 0.0

    def _walked_s(self, flight_s: float) -> float:
        if self._leg_s <= 0.0:
            return flight_s
        phase = flight_s % (2.0 * self._leg_s)
        return min(phase, 2.0 * self._leg_s - phase)


def targets(options: Options) -> list[Target]:
    """Targets of a flight, on its surface."""
    surface = Surface(options)
    return [Target(one, options.flight.centre, surface) for one in options.targets]
