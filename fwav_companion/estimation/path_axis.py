"""Kalman filter and Rauch-Tung-Striebel smoother of one coordinate of the reported path, in plain floats."""

from __future__ import annotations

import math

# Reported velocities are wrong by 0.05 m/s, correlated over 0.1 s.
VELOCITY_SIGMA_M_S = 0.05
VELOCITY_NOISE = VELOCITY_SIGMA_M_S**2 * 0.1  # m^2/s
_LEAST_NOISE_M = 0.004  # GLOBAL_POSITION_INT has steps of 1.1 cm: a third of one
_FORGIVEN_M = 0.05  # added to every expected innovation: steps of the format and of slow telemetry
_OPEN_M2 = 1e4  # variance after a step: the filter restarts there
_MOST = 8192  # samples held; half of them go at once


class PathAxis:
    """A random walk driven by the reported velocity, measured by the reported position."""

    def __init__(self, noise_m: float, process_noise: float = VELOCITY_NOISE, *, driven: bool = True) -> None:
        """noise_m: white; process_noise: m^2/s; driven: whether the velocity drives it."""
        self.noise_m, self.process_noise, self.driven = noise_m, process_noise, driven
        self.r = max(noise_m, _LEAST_NOISE_M) ** 2
        self.filtered: list[tuple[float, float]] = []  # mean m, variance m^2
        self.predicted: list[tuple[float, float]] = []

    def predict(self, increment_m: float, dt_s: float) -> None:
        """Move to the next sample's time."""
        if self.filtered:
            mean, variance = self.filtered[-1]
            moved = mean + increment_m if self.driven else mean
            self.predicted.append((moved, variance + self.process_noise * dt_s))

    def innovation_sigmas(self, z: float) -> float:
        """Absolute innovation over its standard deviation."""
        mean, variance = self.predicted[-1]
        return abs(z - mean) / math.sqrt(variance + self.r + _FORGIVEN_M**2)

    def reopen(self) -> None:
        """Forget where the coordinate was: the next sample begins a new piece."""
        mean, variance = self.predicted[-1]
        self.predicted[-1] = mean, variance + _OPEN_M2

    def update(self, z: float) -> None:
        """Take a reported coordinate; the first one starts the filter."""
        if not self.filtered:
            self.predicted.append((z, self.r))
            self.filtered.append((z, self.r))
            return
        mean, variance = self.predicted[-1]
        gain = variance / (variance + self.r)
        self.filtered.append((mean + gain * (z - mean), (1.0 - gain) * variance))
        if len(self.filtered) > _MOST:
            del self.filtered[: _MOST // 2], self.predicted[: _MOST // 2]

    def smoothed(self, count: int, later: int = 0) -> list[float]:
        """The newest `count` smoothed values before `later` ones, oldest first, by these alone (Rauch, Tung & Striebel
        1965).
        """
        newest = max(0, len(self.filtered) - 1 - later)
        last = self.filtered[newest][0]
        values = [last]
        for i in range(newest - 1, max(-1, newest - count), -1):
            mean, variance = self.filtered[i]
            next_mean, next_variance = self.predicted[i + 1]
            last = mean + variance / next_variance * (last - next_mean)
            values.append(last)
        values.reverse()
        return values

    def remaining_noise(self, step_s: float) -> tuple[float, float]:
        """Standard deviation (m) and correlation time (s) of the smoothed coordinate's error.

        Steady state of the random walk with white noise: the smoother's variance is sqrt(q r dt) / 2.
        """
        r = self.noise_m**2 * max(0.1, step_s)
        return (self.process_noise * r) ** 0.25 / math.sqrt(2.0), max(0.05, math.sqrt(r / self.process_noise))
