"""The target's place, and the error of the vehicle's position, from the apparent place that fixes show.

The apparent place is the place plus the present error of the vehicle's position. That error is a critically damped
second-order Gauss-Markov process (Gelb 1974, ch. 2): receivers' errors move smoothly. A first-order process with the
same sigma and time constant would move by 0.18 m within a second (1 m, 60 s), this one by 0.03 m. Its correlation is
``sigma^2 (1 + w t) exp(-w t)``; the integral is that of a first-order process with the time constant ``2 / w``.

The apparent place is filtered at every fix; place, error and rate once a second, as one scalar Kalman filter for both
axes: the wander is the same along each, and what fixes do not show equally along both is small beside it.
"""

from __future__ import annotations

from math import exp, inf, sqrt

import msgspec

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.tracking.filters.consider_biases import Row
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate

STEP_S = 1.0
"""Least interval of an update: within it the error of 1 m over 60 s moves by 0.03 m."""


class PositionWander(msgspec.Struct, frozen=True, gc=False):
    """The process of each horizontal axis."""

    sigma_m: float
    """One sigma of the error; 0: the position is exact."""
    rate: float
    """Angular frequency w, 1/s; 0: the error is constant."""

    def apparent_noise(self, interval_s: float, variance: float) -> float:
        """Variance by which the apparent place moves within an interval, each axis, m^2; ``variance``: its own before.

        The filter of a random walk of density q looks back T = variance / q. The error moves by rate T within that, so
        q = rate^2 T = rate sqrt(variance). Between sparse fixes it is the movement itself, 2 sigma^2 (1 - correlation).
        """
        if self.sigma_m == 0.0:
            return 0.0
        turn = self.rate * interval_s
        moved = 2.0 * self.sigma_m**2 * (1.0 - (1.0 + turn) * exp(-turn))
        return max(moved, self.rate * self.sigma_m * sqrt(variance) * interval_s)


def position_wander(sigma_m: float, time_constant_s: float) -> PositionWander:
    """The process with this sigma and the integral time of a first-order process with this time constant."""
    return PositionWander(sigma_m, 2.0 / time_constant_s if 0.0 < time_constant_s < inf else 0.0)


class WanderingPlace(msgspec.Struct, frozen=True, gc=False):
    """Place, error of the vehicle's position and its rate; north and east of each, with one covariance for both."""

    place: tuple[float, float]
    error: tuple[float, float]
    rate: tuple[float, float]
    place_variance: float
    place_error: float
    place_rate: float
    error_variance: float
    error_rate: float
    rate_variance: float
    shared: tuple[Row, Row]
    """cov(place error, b / sigma), metres: north and east."""
    error_shared: tuple[Row, Row]
    rate_shared: tuple[Row, Row]

    @property
    def estimate(self) -> PointEstimate:
        """The place with its covariance."""
        noise: Symmetric2 = (self.place_variance, 0.0, self.place_variance)
        return PointEstimate(self.place[0], self.place[1], noise, self.shared)

    def update(self, apparent: PointEstimate, wander: PositionWander, interval_s: float) -> WanderingPlace:
        """The state after the apparent place ``interval_s`` after the last one."""
        w, s2 = wander.rate, wander.sigma_m**2
        decay = exp(-w * interval_s)
        ee, er = decay * (1.0 + w * interval_s), decay * interval_s
        re, rr = -decay * w * w * interval_s, decay * (1.0 - w * interval_s)
        r2 = w * w * s2
        # Transition of the covariance; the process noise is stationary minus what is left of it.
        tt = self.place_variance
        te = ee * self.place_error + er * self.place_rate
        tr = re * self.place_error + rr * self.place_rate
        pp, pr, vv = self.error_variance - s2, self.error_rate, self.rate_variance - r2
        error = ee * ee * pp + 2.0 * ee * er * pr + er * er * vv + s2
        cross = ee * re * pp + (ee * rr + er * re) * pr + er * rr * vv
        rate = re * re * pp + 2.0 * re * rr * pr + rr * rr * vv + r2
        # What the biases do changes with the geometry, too: taken for wander it would be extrapolated.
        north_variance, _, east_variance = apparent.cov
        noise = 0.5 * (north_variance + east_variance)
        by_place, by_error, by_rate = tt + te, te + error, tr + cross
        scale = 1.0 / (by_place + by_error + noise)
        k_place, k_error, k_rate = by_place * scale, by_error * scale, by_rate * scale
        values = zip((apparent.north_m, apparent.east_m), self.place, self.error, self.rate, strict=True)
        north, east = (
            _blended((a,), (t,), (ee * p + er * v,), (re * p + rr * v,), gains=(k_place, k_error, k_rate))
            for a, t, p, v in values
        )
        rows = []
        for own, t, p, v in zip(apparent.shared, self.shared, self.error_shared, self.rate_shared, strict=True):
            moved_p = tuple([ee * x + er * y for x, y in zip(p, v, strict=True)])
            moved_v = tuple([re * x + rr * y for x, y in zip(p, v, strict=True)])
            rows.append(_blended(own, t, moved_p, moved_v, gains=(k_place, k_error, k_rate)))
        (shared_n, error_n, rate_n), (shared_e, error_e, rate_e) = rows
        return WanderingPlace(
            place=(north[0][0], east[0][0]),
            error=(north[1][0], east[1][0]),
            rate=(north[2][0], east[2][0]),
            place_variance=tt - k_place * by_place,
            place_error=te - k_place * by_error,
            place_rate=tr - k_place * by_rate,
            error_variance=error - k_error * by_error,
            error_rate=cross - k_error * by_rate,
            rate_variance=rate - k_rate * by_rate,
            shared=(shared_n, shared_e),
            error_shared=(error_n, error_e),
            rate_shared=(rate_n, rate_e),
        )

    def with_fresh_error(self, wander: PositionWander) -> WanderingPlace:
        """The state with an error of which nothing is known but the process."""
        variance, nothing = wander.sigma_m**2, (0.0,) * len(self.shared[0])
        return msgspec.structs.replace(
            self,
            error=(0.0, 0.0),
            rate=(0.0, 0.0),
            place_error=0.0,
            place_rate=0.0,
            error_variance=variance,
            error_rate=0.0,
            rate_variance=variance * wander.rate**2,
            error_shared=(nothing, nothing),
            rate_shared=(nothing, nothing),
        )

    def with_jump(self, variance: float) -> WanderingPlace:
        """The state with the error free to have moved by ``variance``, m^2."""
        return msgspec.structs.replace(self, error_variance=self.error_variance + variance)


def first_place(apparent: PointEstimate, wander: PositionWander) -> WanderingPlace:
    """The state by one apparent place: the place there, and the error at its prior."""
    variance = wander.sigma_m**2
    none = (0.0,) * len(apparent.shared[0])
    return WanderingPlace(
        place=(apparent.north_m, apparent.east_m),
        error=(0.0, 0.0),
        rate=(0.0, 0.0),
        place_variance=0.5 * (apparent.noise[0] + apparent.noise[2]) + variance,
        place_error=-variance,
        place_rate=0.0,
        error_variance=variance,
        error_rate=0.0,
        rate_variance=variance * wander.rate**2,
        shared=apparent.shared,
        error_shared=(none, none),
        rate_shared=(none, none),
    )


def _blended(apparent: Row, place: Row, error: Row, rate: Row, *, gains: tuple[float, float, float]) -> tuple[Row, ...]:
    """Place, error and rate after the apparent place by these gains; values and rows of C alike."""
    off = [a - t - p for a, t, p in zip(apparent, place, error, strict=True)]
    return tuple(
        tuple([x + gain * o for x, o in zip(row, off, strict=True)])
        for row, gain in zip((place, error, rate), gains, strict=True)
    )
