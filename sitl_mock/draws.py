"""Errors that the seed decides: the constant biases of a flight, and errors that wander."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, radians, sqrt
from random import Random

from sitl_mock.option_types import PositionShift
from sitl_mock.options import Options
from sitl_mock.rotation import Vector

LONGEST_READOUT_S = 0.075
"""Readout of the slowest sensors: photo cameras of 24 x 36 mm with electronic shutters."""
GRID_PARTS = 60
"""Grid steps per time constant: interpolation then loses less than one percent of a wander's variance."""


@dataclass(frozen=True)
class DrawnBiases:
    """True errors of this flight. Degrees, metres, seconds."""

    attitude_roll_deg: float
    attitude_pitch_deg: float
    heading_deg: float
    mount_deg: Vector
    time_offset_s: float
    height_m: float
    altitude_m: float
    position_sigma_m: float
    readout_s: float
    position_delay_s: float
    lever_arm_m: Vector
    gimbal_yaw_deg: float
    gimbal_third_deg: float
    """Error of a gimbal's attitude about its third axis; the others are those of roll and pitch."""
    gimbal_delay_s: float


def draw(options: Options) -> DrawnBiases:
    """Draws each bias from its own generator: setting one leaves the others unchanged."""
    biases, priors = options.biases, options.priors

    def one(name: str, chosen: float | None, sigma: float) -> float:
        if chosen is not None:
            return chosen
        return Random(f"{options.seed}/bias/{name}").gauss(0.0, sigma) if options.draw_biases else 0.0

    mount = biases.mount_deg or tuple(one(f"mount{axis}", None, priors.mount_bias_deg) for axis in range(3))
    lever = biases.lever_arm_m or tuple(one(f"lever{axis}", None, priors.lever_arm_sigma_m) for axis in range(3))
    return DrawnBiases(
        one("roll", biases.attitude_roll_deg, priors.attitude_bias_deg),
        one("pitch", biases.attitude_pitch_deg, priors.attitude_bias_deg),
        one("heading", biases.heading_deg, priors.heading_bias_deg),
        mount,  # type: ignore[arg-type]
        one("time", biases.time_offset_s, priors.time_offset_sigma_s),
        one("height", biases.height_m, priors.height_bias_m),
        biases.altitude_m,
        _position_sigma(options),
        _readout(options),
        one("position_delay", biases.position_delay_s, priors.position_delay_sigma_s),
        lever,  # type: ignore[arg-type]
        one("gimbal_yaw", biases.gimbal_yaw_deg, priors.gimbal_yaw_bias_deg),
        one("gimbal_third", None, priors.attitude_bias_deg),
        one("gimbal_delay", biases.gimbal_delay_s, priors.gimbal_delay_sigma_s),
    )


def _position_sigma(options: Options) -> float:
    if options.biases.position_m is not None:
        return options.biases.position_m
    return options.priors.position_bias_m if options.draw_biases else 0.0


def _readout(options: Options) -> float:
    if options.biases.readout_s is not None:
        return options.biases.readout_s
    if options.camera.readout_s is not None:
        return options.camera.readout_s
    return Random(f"{options.seed}/bias/readout").uniform(0.0, min(1.0 / options.camera.fps, LONGEST_READOUT_S))


def wander_time_s(options: Options) -> float:
    """Time constant of the position's wander, seconds."""
    drawn_from = options.autopilot.position_wander_times_s
    if drawn_from is None:
        return options.priors.position_bias_time_s
    return exp(Random(f"{options.seed}/wander/time").uniform(*map(log, drawn_from)))


class Wander:
    """First-order Gauss-Markov error, stationary from the start, at any instant."""

    def __init__(self, sigma: float, time_s: float, rng: Random) -> None:
        self._sigma, self._rng = sigma, rng
        self._step_s = time_s / GRID_PARTS
        self._keep = exp(-1.0 / GRID_PARTS)
        self._grid = [rng.gauss(0.0, sigma)]

    def at(self, t: float) -> float:
        """Error at t seconds."""
        index = max(0.0, t / self._step_s)
        whole = int(index)
        while len(self._grid) < whole + 2:
            fresh = self._rng.gauss(0.0, self._sigma) * sqrt(1.0 - self._keep * self._keep)
            self._grid.append(self._keep * self._grid[-1] + fresh)
        before, after = self._grid[whole], self._grid[whole + 1]
        return before + (index - whole) * (after - before)


class SmoothWander:
    """Second-order Gauss-Markov error, stationary from the start: its rate is finite, as that of a GNSS receiver's
    error.

    Two equal first-order lags in a row: correlation (1 + |t| / T) exp(-|t| / T), with T such that the variance of a
    mean over long times equals that of the first-order error with the same ``time_s`` (4 T = 2 ``time_s``).
    """

    def __init__(self, sigma: float, time_s: float, rng: Random) -> None:
        self._rng = rng
        self._lag_s = time_s / 2.0
        self._step_s = self._lag_s / GRID_PARTS
        # State (x, T x'): its stationary covariance is sigma^2 * identity.
        self._grid = [(rng.gauss(0.0, sigma), rng.gauss(0.0, sigma))]
        h = 1.0 / GRID_PARTS
        keep = exp(-h)
        self._step = ((keep * (1.0 + h), keep * h), (-keep * h, keep * (1.0 - h)))
        (a, b), (c, d) = self._step
        xx, xv, vv = (1.0 - a * a - b * b, -(a * c + b * d), 1.0 - c * c - d * d)
        root = sqrt(max(0.0, xx))
        self._noise = (sigma * root, sigma * xv / root, sigma * sqrt(max(0.0, vv - xv * xv / xx)))

    def at(self, t: float) -> float:
        """Error at t seconds: cubic Hermite interpolation of the grid's values and rates."""
        index = max(0.0, t / self._step_s)
        whole = int(index)
        while len(self._grid) < whole + 2:
            self._grid.append(self._next(*self._grid[-1]))
        (x0, v0), (x1, v1) = self._grid[whole], self._grid[whole + 1]
        s, h = index - whole, 1.0 / GRID_PARTS
        p, q = v0 * h - (x1 - x0), (x1 - x0) - v1 * h
        return x0 + s * (x1 - x0) + s * (1.0 - s) * (p * (1.0 - s) + q * s)

    def _next(self, x: float, v: float) -> tuple[float, float]:
        (a, b), (c, d) = self._step
        first, second = self._rng.gauss(0.0, 1.0), self._rng.gauss(0.0, 1.0)
        n_x, n_xv, n_v = self._noise
        return (a * x + b * v + n_x * first, c * x + d * v + n_xv * first + n_v * second)


def shifted(shifts: tuple[PositionShift, ...], t: float) -> tuple[float, float]:
    """Shift of the estimator's position at t seconds: north, east, metres."""
    north = east = 0.0
    for from_s, to_s, by_north, by_east in shifts:
        x = min(1.0, max(0.0, (t - from_s) / (to_s - from_s))) if to_s > from_s else float(t >= from_s)
        share = x * x * (3.0 - 2.0 * x)
        north, east = north + share * by_north, east + share * by_east
    return north, east


def radians3(v: Vector) -> Vector:
    """Converts degrees to radians, by component."""
    return (radians(v[0]), radians(v[1]), radians(v[2]))
