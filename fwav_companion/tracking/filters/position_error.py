"""The error of the vehicle's reported position: it wanders, so an average of a second does not remove it."""

from __future__ import annotations

from functools import lru_cache
from math import exp, inf, sqrt

import msgspec

from fwav_companion.types import Bias, ErrorPriors, VehicleState

DRIFT_TIMES_S = (inf,)
"""Time constants of an error that drifts: it never returns."""


class PositionError(msgspec.Struct, frozen=True, gc=False):
    """Wander of the vehicle's position along each horizontal axis: a sum of Gauss-Markov processes of equal variance.

    Where the time constant is not known, the error is a sum of several processes (Gelb 1974, ch. 2).
    """

    sigma_m: float
    """One sigma of the error; 0: the position is exact."""
    rates: tuple[float, ...]
    """Twice the inverse of each process' time constant, 1/s; 0: that part of the error is constant."""

    def movement(self, interval_s: float) -> float:
        """Variance of the movement within an interval, each axis, m^2: 2 sigma^2 (1 - correlation)."""
        if self.sigma_m == 0.0:
            return 0.0
        moved = 0.0
        for rate in self.rates:
            moved += 1.0 - exp(-0.5 * (rate * interval_s))
        return 2.0 * (self.sigma_m**2 / len(self.rates)) * moved


class PositionErrorModel:
    """The error as the configuration and the receiver's own accuracy state it."""

    __slots__ = ("_configured", "_times_s")

    def __init__(self, priors: ErrorPriors) -> None:
        north, east = priors.sigma(Bias.POSITION_NORTH), priors.sigma(Bias.POSITION_EAST)
        self._times_s = priors.position_times_s
        self._configured = _position_error(sqrt(0.5 * (north * north + east * east)), self._times_s)

    def at(self, state: VehicleState) -> PositionError:
        """The error with the sigma that the receiver reports; without a report, the configured one."""
        sigma_m = state.position_bias_m
        if state.position_drifts and sigma_m:
            return _position_error(sigma_m, DRIFT_TIMES_S)
        if sigma_m is None or self._configured.sigma_m == 0.0:
            return self._configured
        return _position_error(sigma_m, self._times_s)


@lru_cache(maxsize=4)
def _position_error(sigma_m: float, time_constants_s: tuple[float, ...]) -> PositionError:
    """The error with this sigma. Cached, because a receiver reports the same sigma at many fixes."""
    return PositionError(sigma_m, tuple([2.0 / each if 0.0 < each < inf else 0.0 for each in time_constants_s]))
