"""What the seed decides: the flight's biases, and errors that wander."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, radians, sqrt
from random import Random

from sitl_mock.options import Options
from sitl_mock.rotation import Vector

GRID_PARTS = 60
"""Grid steps in a time constant: interpolation then loses under one percent of a wander's variance."""


@dataclass(frozen=True)
class DrawnBiases:
    """The errors of this flight, as they are. Degrees, metres, seconds."""

    attitude_roll_deg: float
    attitude_pitch_deg: float
    heading_deg: float
    mount_deg: Vector
    time_offset_s: float
    height_m: float
    position_sigma_m: float
    readout_s: float


def draw(options: Options) -> DrawnBiases:
    """Each bias from its own generator: naming one leaves the others what they were."""
    asked, priors = options.biases, options.priors

    def one(name: str, chosen: float | None, sigma: float) -> float:
        if chosen is not None:
            return chosen
        return Random(f"{options.seed}/bias/{name}").gauss(0.0, sigma) if options.draw_biases else 0.0

    mount = asked.mount_deg or tuple(one(f"mount{axis}", None, priors.mount_bias_deg) for axis in range(3))
    return DrawnBiases(
        one("roll", asked.attitude_roll_deg, priors.attitude_bias_deg),
        one("pitch", asked.attitude_pitch_deg, priors.attitude_bias_deg),
        one("heading", asked.heading_deg, priors.heading_bias_deg),
        mount,  # type: ignore[arg-type]
        one("time", asked.time_offset_s, priors.time_offset_sigma_s),
        one("height", asked.height_m, priors.height_bias_m),
        _position_sigma(options),
        _readout(options),
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
    return Random(f"{options.seed}/bias/readout").uniform(0.0, 1.0 / options.camera.fps)


class Wander:
    """A first-order Gauss-Markov error that is stationary from the start: ask for any instant."""

    def __init__(self, sigma: float, time_s: float, rng: Random) -> None:
        self._sigma, self._rng = sigma, rng
        self._step_s = time_s / GRID_PARTS
        self._keep = exp(-1.0 / GRID_PARTS)
        self._grid = [rng.gauss(0.0, sigma)]

    def at(self, t: float) -> float:
        """The error at t seconds."""
        index = max(0.0, t / self._step_s)
        whole = int(index)
        while len(self._grid) < whole + 2:
            fresh = self._rng.gauss(0.0, self._sigma) * sqrt(1.0 - self._keep * self._keep)
            self._grid.append(self._keep * self._grid[-1] + fresh)
        before, after = self._grid[whole], self._grid[whole + 1]
        return before + (index - whole) * (after - before)


def radians3(v: Vector) -> Vector:
    """Degrees to radians, by component."""
    return (radians(v[0]), radians(v[1]), radians(v[2]))
