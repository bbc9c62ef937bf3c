"""A copter in LAND that follows LANDING_TARGET, as ArduCopter does: its own motion, from first sight to the ground.

Frozen by the autopilot's own rules (`AP:libraries/AC_PrecLand/AC_PrecLand.cpp`, `AP:ArduCopter/mode.cpp`
land_run_vertical_control, defaults of the parameters): it shows what a landing by some vectors is worth, so it is not
tuned to them. Left out: retries (as with PLND_STRICT 0 a lost target leaves it to land where it is), and errors of the
copter's own velocity, so that a miss is one of the vectors.
"""

from __future__ import annotations

from math import atan, cos, hypot, radians, sin, sqrt
from random import Random
from typing import NamedTuple, Protocol

from sitl_mock.options import Options
from sitl_mock.patterns import Pair, Path
from sitl_mock.precland_filter import RelativeTarget
from sitl_mock.rotation import Vector
from sitl_mock.slow_drift import SlowDrift

STEP_S = 0.01
LAND_SPEED_M_S = 0.5
"""LAND_SPEED: below 10 m."""
NEAR_M = (0.35, 2.0)
"""Heights between which the descent is half as fast, and slower by the error (land_run_vertical_control)."""
ACCEPTABLE_ERROR_M, LEAST_DESCENT_M_S = 0.15, 0.1
FARTHEST_M = 2.5
"""PLND_XY_DIST_MAX: no descent where the target is farther."""
POSITION_GAIN, VELOCITY_GAIN, INTEGRAL_GAIN = 1.0, 2.0, 1.0
"""PSC_POSXY_P, PSC_VELXY_P, PSC_VELXY_I."""
MOST_ACCELERATION_M_S2, MOST_JERK_M_S3 = 2.5, 5.0
"""WPNAV_ACCEL, PSC_JERK_XY."""
TILT_S, CLIMB_S = 0.15, 0.3
"""Time constants of the tilt and of the climb rate."""
GRAVITY = 9.80665


class Deck(Protocol):
    """The surface that the copter lands on, and its landing point."""

    def at(self, flight_s: float) -> Vector:
        """Landing point, the world's NED, metres."""

    def velocity_at(self, flight_s: float) -> Pair:
        """Its velocity, north and east, m/s."""


class Touchdown(NamedTuple):
    """Where the copter came down."""

    at_s: float
    off_m: Pair
    """North and east of the landing point, metres."""

    @property
    def miss_m(self) -> float:
        """Horizontal distance from the landing point, metres."""
        return hypot(*self.off_m)


class Knot(NamedTuple):
    """Motion at the begin of a step, about the flight centre; the jerk holds through the step."""

    at: Pair
    velocity: Pair
    tilt: Pair
    """Acceleration by the tilt, north and east, m/s^2."""
    jerk: Pair
    gust: Pair
    """Acceleration by the wind, m/s^2."""
    up: float
    climb: float
    sinking: float
    """Acceleration upward, m/s^2."""


class Lander:
    """The motion as a pattern of :class:`Flight`. Steps are computed as they are asked for, each once: what arrives
    later acts later.
    """

    def __init__(self, options: Options, deck: Deck) -> None:
        flight, lander = options.flight, options.lander
        self._deck, self._centre = deck, flight.centre
        self._lands_at_s, self._gear_m = lander.at_s, lander.gear_m
        self._follows = lander.moving_target
        self._heading = radians(flight.fixed_heading_deg)
        rng = Random(f"{options.seed}/gust")
        self._gusts = [SlowDrift(lander.gust_m_s2, rng) for _ in range(2)]
        self._target = RelativeTarget()
        self._integral: Pair = (0.0, 0.0)
        self._hold: Pair | None = None
        """Place that it holds once it has lost its target."""
        self._height_m = flight.height_m
        self._offset: Pair = flight.offset_m
        self._knots = [self._knot(0, flight.offset_m, (0.0, 0.0), (0.0, 0.0), flight.height_m, 0.0)]
        self._seen_down_m: float | None = None
        """Height above the target by the last vector, metres."""
        self.touchdown: Touchdown | None = None
        self.texts: list[str] = []
        """Texts for the pilot that are still to be sent."""

    def at(self, flight_s: float) -> Path:
        """Path at an instant."""
        while (len(self._knots) - 1) * STEP_S < flight_s:
            self._step()
        index = max(0, min(int(flight_s / STEP_S), len(self._knots) - 1))
        knot, d = self._knots[index], max(0.0, flight_s) - index * STEP_S
        at, velocity, tilt = _moved(knot, d)
        up = knot.up + knot.climb * d + 0.5 * knot.sinking * d * d
        zero = (0.0, 0.0)
        return Path(at, velocity, zero, zero, (up, knot.climb + knot.sinking * d), tilt=self._tilted(tilt, knot.jerk))

    def hear(self, relative_ned: Vector, stamp_ms: int, seen_s: float) -> None:
        """Takes one vector to the target, in the autopilot's own NED; ``seen_s``: the instant at which it held."""
        own = self.at(seen_s)
        north, east, down = relative_ned
        place = (own.at[0] + north, own.at[1] + east)
        if self._target.hear(place, down, stamp_ms, seen_s):
            self._seen_down_m = down

    def _step(self) -> None:
        k = len(self._knots)
        before, t = self._knots[-1], k * STEP_S
        at, velocity, tilt = _moved(before, STEP_S)
        up = before.up + before.climb * STEP_S + 0.5 * before.sinking * STEP_S * STEP_S
        climb = before.climb + before.sinking * STEP_S
        self._lands(t, at, up)
        if self.touchdown is not None:
            self._knots.append(self._knot_on_deck(t, at))
            return
        self.texts += self._target.advance(t)
        self._knots.append(self._knot(k, at, velocity, tilt, up, climb))

    def _lands(self, t: float, at: Pair, up: float) -> None:
        north, east, down = self._deck.at(t)
        if self.touchdown is None and up - self._gear_m <= -down:
            off = (at[0] + self._centre[0] - north, at[1] + self._centre[1] - east)
            self.touchdown = Touchdown(t, off)

    def _knot(self, k: int, at: Pair, velocity: Pair, tilt: Pair, up: float, climb: float) -> Knot:
        """The motion from here, by what is known of the target."""
        t = k * STEP_S
        aim, aim_velocity = self._aim(t, at)
        error_m = hypot(*aim)
        gust = (self._gusts[0].value(t), self._gusts[1].value(t))
        wanted = _toward(aim, error_m, aim_velocity)
        lag = (wanted[0] - velocity[0], wanted[1] - velocity[1])
        self._integral = (
            self._integral[0] + INTEGRAL_GAIN * lag[0] * STEP_S,
            self._integral[1] + INTEGRAL_GAIN * lag[1] * STEP_S,
        )
        acceleration = _limited(
            (VELOCITY_GAIN * lag[0] + self._integral[0], VELOCITY_GAIN * lag[1] + self._integral[1]),
            MOST_ACCELERATION_M_S2,
        )
        jerk = _limited(((acceleration[0] - tilt[0]) / TILT_S, (acceleration[1] - tilt[1]) / TILT_S), MOST_JERK_M_S3)
        sinking = (self._climb_rate(t, error_m, up) - climb) / CLIMB_S
        return Knot(at, velocity, tilt, jerk, gust, up, climb, sinking)

    def _knot_on_deck(self, t: float, at: Pair) -> Knot:
        """The motion after the touchdown: that of the deck, which may heave."""
        still, (down, down_next) = (0.0, 0.0), (self._deck.at(each)[2] for each in (t, t + STEP_S))
        climb = (down - down_next) / STEP_S
        return Knot(at, self._deck.velocity_at(t), still, still, still, self._gear_m - down, climb, 0.0)

    def _aim(self, t: float, at: Pair) -> tuple[Pair, Pair]:
        """The place to go to, from the copter, and its velocity."""
        followed = self._target.followed
        if t >= self._lands_at_s and followed is not None:
            self._hold = at
            (north, east), velocity = followed
            return (north - at[0], east - at[1]), velocity if self._follows else (0.0, 0.0)
        if self._hold is not None:
            return (self._hold[0] - at[0], self._hold[1] - at[1]), (0.0, 0.0)
        north, east, _ = self._deck.at(t)  # the pilot keeps it near the pad until then
        held = (north - self._centre[0] + self._offset[0], east - self._centre[1] + self._offset[1])
        return (held[0] - at[0], held[1] - at[1]), self._deck.velocity_at(t)

    def _climb_rate(self, t: float, error_m: float, up: float) -> float:
        if t < self._lands_at_s:
            return self._height_m - up
        if self._target.followed is None or self._seen_down_m is None:
            return -LAND_SPEED_M_S
        if error_m > FARTHEST_M:
            return 0.0
        if not NEAR_M[0] < self._seen_down_m < NEAR_M[1]:
            return -LAND_SPEED_M_S
        fastest = 0.5 * LAND_SPEED_M_S
        return min(-LEAST_DESCENT_M_S, -fastest + error_m * fastest / ACCEPTABLE_ERROR_M)

    def _tilted(self, tilt: Pair, jerk: Pair) -> tuple[float, float, float, float]:
        """Roll, its rate, pitch and its rate of these accelerations, radians."""
        c, s = cos(self._heading), sin(self._heading)
        (forward, right), (forward_rate, right_rate) = (
            ((c * n + s * e) / GRAVITY, (c * e - s * n) / GRAVITY) for n, e in (tilt, jerk)
        )
        return (
            atan(right),
            right_rate / (1.0 + right * right),
            -atan(forward),
            -forward_rate / (1.0 + forward * forward),
        )


def _moved(knot: Knot, d: float) -> tuple[Pair, Pair, Pair]:
    """Place, velocity and acceleration by the tilt, ``d`` seconds after the begin of the step."""
    place, speed, tilt = [], [], []
    for p, v, a, j, g in zip(knot.at, knot.velocity, knot.tilt, knot.jerk, knot.gust, strict=True):
        place.append(p + d * (v + d * (0.5 * (a + g) + d * j / 6.0)))
        speed.append(v + d * (a + g + 0.5 * d * j))
        tilt.append(a + d * j)
    return (place[0], place[1]), (speed[0], speed[1]), (tilt[0], tilt[1])


def _toward(aim: Pair, error_m: float, aim_velocity: Pair) -> Pair:
    """Velocity toward a place: proportional near it, by the square root law of the controllers far from it."""
    if error_m == 0.0:
        return aim_velocity
    linear_m = MOST_ACCELERATION_M_S2 / POSITION_GAIN**2
    speed = POSITION_GAIN * error_m
    if error_m > linear_m:
        speed = sqrt(2.0 * MOST_ACCELERATION_M_S2 * (error_m - 0.5 * linear_m))
    return aim_velocity[0] + speed * aim[0] / error_m, aim_velocity[1] + speed * aim[1] / error_m


def _limited(vector: Pair, most: float) -> Pair:
    size = hypot(*vector)
    return vector if size <= most else (vector[0] * most / size, vector[1] * most / size)
