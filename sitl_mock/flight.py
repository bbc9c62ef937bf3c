"""The vehicle's motion as a pure function of time: pattern, wander, flapping and heave, with exact derivatives."""

from __future__ import annotations

from math import atan, atan2, cos, hypot, pi, radians, sin
from random import Random
from typing import NamedTuple, Protocol

from sitl_mock.clock import SimulatorTime
from sitl_mock.hand import Hand
from sitl_mock.options import FlightOptions
from sitl_mock.patterns import Path, Pattern
from sitl_mock.rotation import Matrix, Vector, body_rates, matrix_from_euler
from sitl_mock.slow_drift import SlowDrift

GRAVITY = 9.80665


class State(NamedTuple):
    """True state at an instant. Positions in the world's NED, metres; angles in radians."""

    flight_s: float
    position: Vector
    velocity: Vector
    euler: Vector
    """Roll, pitch, yaw, radians; yaw may exceed one turn."""
    rates: Vector
    """Body rates, rad/s."""

    @property
    def ned_from_body(self) -> Matrix:
        """Attitude as a matrix."""
        return matrix_from_euler(*self.euler)


class PathSource(Protocol):
    """A path over the ground."""

    def at(self, flight_s: float) -> Path:
        """Path at an instant."""


class Flight:
    """The vehicle's motion; instants may be evaluated in any order."""

    def __init__(self, options: FlightOptions, seed: int, course: PathSource | None = None) -> None:
        """``course``: replaces the pattern."""
        self._o = options
        self._pattern: PathSource = course or Pattern(options)
        usual = {"orbit": "centre", "hover": "fixed", "hand": "fixed", "landing": "fixed"}.get(
            options.pattern, "course"
        )
        self._heading = options.heading or usual
        rng = Random(f"{seed}/flight")
        self._wander = [SlowDrift(options.wander_m if axis < 2 else options.wander_m / 2.0, rng) for axis in range(3)]
        self._sway = [SlowDrift(radians(options.wander_deg), rng) for _ in range(3)]
        self._phases = [rng.uniform(0.0, 2.0 * pi) for _ in range(4)]
        self._hand = Hand(options, rng) if options.pattern == "hand" else None
        self._level = radians(options.roll_deg), radians(options.pitch_deg)
        self._flap = radians(options.flapping_roll_deg), radians(options.flapping_pitch_deg)
        self._beat = 2.0 * pi * options.flapping_hz, 2.0 * pi * 0.1, options.flapping_modulation

    def at(self, flight_s: float) -> State:
        """State at an instant."""
        path = self._pattern.at(flight_s)
        stroke, stroke_rate = self._stroke(flight_s)
        roll, roll_rate, pitch, pitch_rate, yaw_rate = self._turning(flight_s, path, stroke, stroke_rate)
        position, velocity = self._place(flight_s, path, stroke, stroke_rate)
        return State(
            flight_s,
            position,
            velocity,
            (roll, pitch, self._yaw(flight_s, path)),
            body_rates(roll, pitch, roll_rate, pitch_rate, yaw_rate),
        )

    def rates(self, flight_s: float) -> Vector:
        """Body rates alone, rad/s: a gyro evaluates them a thousand times a second."""
        stroke, stroke_rate = self._stroke(flight_s)
        roll, roll_rate, pitch, pitch_rate, yaw_rate = self._turning(
            flight_s, self._pattern.at(flight_s), stroke, stroke_rate
        )
        return body_rates(roll, pitch, roll_rate, pitch_rate, yaw_rate)

    def euler(self, flight_s: float) -> Vector:
        """Roll, pitch and yaw alone, radians: an autopilot reports them a hundred times a second."""
        path = self._pattern.at(flight_s)
        return self._angles(flight_s, path, self._phase(flight_s))

    def pose(self, flight_s: float) -> tuple[Vector, Vector]:
        """Position and Euler angles alone: a picture is projected from them several times."""
        path, stroke = self._pattern.at(flight_s), self._phase(flight_s)
        return self._position(flight_s, path, stroke), self._angles(flight_s, path, stroke)

    def _phase(self, t: float) -> float:
        """Phase of the wing stroke."""
        w, slow, m = self._beat
        return w * t + self._phases[0] + m * sin(slow * t + self._phases[3])

    def _angles(self, t: float, path: Path, stroke: float) -> Vector:
        """Euler angles, by the sums of :meth:`_turning` in their order."""
        sway_roll, sway_pitch, _ = self._sway
        roll, pitch = sway_roll.value(t), sway_pitch.value(t)
        if self._hand is not None:
            by_hand = self._hand.angles(t)
            roll, pitch = roll + by_hand[0][0], pitch + by_hand[1][0]
        (level_roll, level_pitch), (flap_roll, flap_pitch) = self._level, self._flap
        tilt_roll, _, tilt_pitch, _ = path.tilt
        return (
            roll + level_roll + self._bank(path) + tilt_roll + flap_roll * sin(stroke + self._phases[1]),
            pitch + level_pitch + tilt_pitch + flap_pitch * sin(stroke),
            self._yaw(t, path),
        )

    def _bank(self, path: Path) -> float:
        """Bank of a turn, radians."""
        if path.heading_deg is not None or self._heading in ("fixed", "centre"):
            return 0.0
        (vn, ve), (an, ae), (wind_n, wind_e) = path.velocity, path.acceleration, self._o.wind_m_s
        vn, ve = vn - wind_n, ve - wind_e
        return atan(self._o.bank * ((vn * ae - ve * an) / hypot(vn, ve)) / GRAVITY)

    def _stroke(self, t: float) -> tuple[float, float]:
        """Phase of the wing stroke and its rate."""
        w, slow, m = self._beat
        angle = slow * t + self._phases[3]
        return w * t + self._phases[0] + m * sin(angle), w + m * slow * cos(angle)

    def _turning(
        self, t: float, path: Path, stroke: float, stroke_rate: float
    ) -> tuple[float, float, float, float, float]:
        """(roll, its rate, pitch, its rate, rate of the yaw): what body rates depend on."""
        sway_roll, sway_pitch, sway_yaw = self._sway
        (roll, roll_rate), (pitch, pitch_rate), yaw_rate = sway_roll.at(t), sway_pitch.at(t), sway_yaw.rate(t)
        course_rate, bank, bank_rate = self._course_turn(path)
        level_roll, level_pitch = self._level
        flap_roll, flap_pitch = self._flap
        if self._hand is not None:
            by_hand = self._hand.angles(t)
            roll, pitch = roll + by_hand[0][0], pitch + by_hand[1][0]
            roll_rate, pitch_rate = roll_rate + by_hand[0][1], pitch_rate + by_hand[1][1]
            yaw_rate += by_hand[2][1]
        roll_phase = stroke + self._phases[1]
        tilt_roll, tilt_roll_rate, tilt_pitch, tilt_pitch_rate = path.tilt
        return (
            roll + level_roll + bank + tilt_roll + flap_roll * sin(roll_phase),
            roll_rate + bank_rate + tilt_roll_rate + flap_roll * stroke_rate * cos(roll_phase),
            pitch + level_pitch + tilt_pitch + flap_pitch * sin(stroke),
            pitch_rate + tilt_pitch_rate + flap_pitch * stroke_rate * cos(stroke),
            yaw_rate + course_rate,
        )

    def _yaw(self, t: float, path: Path) -> float:
        yaw = self._sway[2].value(t)
        if self._hand is not None:
            yaw += self._hand.angles(t)[2][0]
        return yaw + self._course(t, path)

    def _course(self, t: float, path: Path) -> float:
        """Heading without sway and hand."""
        if path.heading_deg is not None:
            return radians(path.heading_deg[0])
        if self._heading == "fixed":
            return radians(self._o.fixed_heading_deg + self._o.turn_deg_s * t)
        if self._heading == "centre":
            north, east = path.at
            return atan2(-east, -north)
        (north, east), (wind_n, wind_e) = path.velocity, self._o.wind_m_s
        return atan2(east - wind_e, north - wind_n)

    def _course_turn(self, path: Path) -> tuple[float, float, float]:
        """(rate of the heading without sway and hand, bank, its rate)."""
        if path.heading_deg is not None:
            return radians(path.heading_deg[1]), 0.0, 0.0
        if self._heading == "fixed":
            return radians(self._o.turn_deg_s), 0.0, 0.0
        if self._heading == "centre":
            (n, e), (vn, ve) = path.at, path.velocity
            return (n * ve - e * vn) / (n * n + e * e), 0.0, 0.0
        (vn, ve), (an, ae), (jn, je) = path.velocity, path.acceleration, path.jerk
        wind_n, wind_e = self._o.wind_m_s
        vn, ve = vn - wind_n, ve - wind_e  # the nose points along the velocity through the air
        speed = hypot(vn, ve)
        sideways = (vn * ae - ve * an) / speed
        sideways_rate = (vn * je - ve * jn) / speed - sideways * (vn * an + ve * ae) / speed**2
        slope, slope_rate = self._o.bank * sideways / GRAVITY, self._o.bank * sideways_rate / GRAVITY
        return sideways / speed, atan(slope), slope_rate / (1.0 + slope * slope)

    def _place(self, t: float, path: Path, stroke: float, stroke_rate: float) -> tuple[Vector, Vector]:
        o = self._o
        (north, north_rate), (east, east_rate), (up, up_rate) = (drift.at(t) for drift in self._wander)
        heave_phase = stroke + self._phases[2]
        height, height_rate = path.up or (o.height_m, 0.0)
        up += height + o.heave_m * sin(heave_phase)
        up_rate += height_rate + o.heave_m * stroke_rate * cos(heave_phase)
        climb, climb_rate = self._climb(t)
        return (
            (path.at[0] + north + o.centre[0], path.at[1] + east + o.centre[1], -up * climb),
            (path.velocity[0] + north_rate, path.velocity[1] + east_rate, -up_rate * climb - up * climb_rate),
        )

    def _position(self, t: float, path: Path, stroke: float) -> Vector:
        """Position, by the sums of :meth:`_place` in their order."""
        o = self._o
        north, east, up = (drift.value(t) for drift in self._wander)
        height, _ = path.up or (o.height_m, 0.0)
        up += height + o.heave_m * sin(stroke + self._phases[2])
        return (path.at[0] + north + o.centre[0], path.at[1] + east + o.centre[1], -up * self._climb(t)[0])

    def _climb(self, t: float) -> tuple[float, float]:
        """(fraction of the flight height, its rate): 1 in flight, smooth through the climb."""
        if self._o.takeoff_at_s is None:
            return 1.0, 0.0
        x = min(1.0, max(0.0, (t - self._o.takeoff_at_s) / self._o.climb_s))
        return x**3 * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * (x * (1.0 - x)) ** 2 / self._o.climb_s


class SimulatedFlight(Flight):
    """The motion in a simulator whose time is not the host's; velocities and rates are per second of its own."""

    def __init__(
        self, options: FlightOptions, seed: int, time: SimulatorTime, course: PathSource | None = None
    ) -> None:
        super().__init__(options, seed, course)
        self._time = time

    def at(self, flight_s: float) -> State:
        """State at an instant of the host."""
        return super().at(self._simulated_s(flight_s))

    def rates(self, flight_s: float) -> Vector:
        """Body rates at an instant of the host."""
        return super().rates(self._simulated_s(flight_s))

    def euler(self, flight_s: float) -> Vector:
        """Euler angles at an instant of the host."""
        return super().euler(self._simulated_s(flight_s))

    def pose(self, flight_s: float) -> tuple[Vector, Vector]:
        """Position and Euler angles at an instant of the host."""
        return super().pose(self._simulated_s(flight_s))

    def _simulated_s(self, flight_s: float) -> float:
        return self._time.simulated_ns(round(flight_s * 1e9)) * 1e-9
