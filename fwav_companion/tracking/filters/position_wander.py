"""Position error of the vehicle as a critically damped second-order Gauss-Markov process (Gelb 1974, ch. 2).

A receiver's error moves smoothly: within a second it goes on as it went. A first-order process with the same sigma and
time constant would jump by 0.18 m within a second (1 m, 60 s), and the place relative to the vehicle could not be
averaged over more than a frame or two. The correlation is ``sigma^2 (1 + w t) exp(-w t)``; its integral is that of a
first-order process with the time constant ``2 / w``.
"""

from __future__ import annotations

from math import exp

import msgspec


class WanderStep(msgspec.Struct, frozen=True, gc=False):
    """Transition of (error, rate) over one interval, and the covariance that it adds."""

    error_error: float
    error_rate: float
    """Seconds."""
    rate_error: float
    """1/s."""
    rate_rate: float
    error_variance: float
    """m^2."""
    cross_variance: float
    """m^2/s."""
    rate_variance: float
    """(m/s)^2."""


class PositionWander(msgspec.Struct, frozen=True, gc=False):
    """The process of each horizontal axis."""

    sigma_m: float
    """One sigma of the error; 0: the position is exact."""
    rate: float
    """Angular frequency w, 1/s; 0: the error is constant."""

    @property
    def rate_variance(self) -> float:
        """Stationary variance of the rate, (m/s)^2."""
        return (self.rate * self.sigma_m) ** 2

    def step(self, interval_s: float) -> WanderStep:
        """The transition over ``interval_s`` seconds; exact for any interval."""
        w, t = self.rate, interval_s
        decay, variance, rate_variance = exp(-w * t), self.sigma_m * self.sigma_m, self.rate_variance
        ee, er, re, rr = decay * (1.0 + w * t), decay * t, -decay * w * w * t, decay * (1.0 - w * t)
        return WanderStep(
            error_error=ee,
            error_rate=er,
            rate_error=re,
            rate_rate=rr,
            error_variance=variance - ee * ee * variance - er * er * rate_variance,
            cross_variance=-ee * re * variance - er * rr * rate_variance,
            rate_variance=rate_variance - re * re * variance - rr * rr * rate_variance,
        )


def position_wander(sigma_m: float, time_constant_s: float) -> PositionWander:
    """The process with this sigma and the integral time of a first-order process with this time constant."""
    steady = not 0.0 < time_constant_s < float("inf")
    return PositionWander(sigma_m, 0.0 if steady else 2.0 / time_constant_s)
