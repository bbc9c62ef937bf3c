"""The target's place, and the error of the vehicle's position, from the apparent place that fixes show.

The apparent place is the place plus the present error of the vehicle's position. That error is a sum of critically
damped second-order Gauss-Markov processes (Gelb 1974, ch. 2): receivers' errors move smoothly. A first-order process
with the same sigma and time constant would move by 0.18 m within a second (1 m, 60 s), this one by 0.03 m. Its
correlation is ``sigma^2 (1 + w t) exp(-w t)``; the integral is that of a first-order process with the time constant
``2 / w``.

Where the time constant is not known, the error is a sum of several: the mean of their correlations is the correlation
of an error whose time constant is drawn among them, so that the claim holds in the mean over receivers.

Not every error is smooth. As far as the fixes show a first-order one (``wander_evidence``), the apparent place moves as
that does. The claim of the place hardly depends on it: both have the same integral.

The apparent place is filtered at every fix; place, errors and rates once a second, as one scalar Kalman filter for both
axes: the wander is the same along each, and what fixes do not show equally along both is small beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, inf, sqrt
from operator import mul
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate
from fwav_companion.tracking.filters.wander_evidence import Mean, with_mean

Column: TypeAlias = tuple[float, ...]
"""One number for each state: the place, then error and rate of each process."""


class PositionWander(msgspec.Struct, frozen=True, gc=False):
    """The error of each horizontal axis: processes of equal variance."""

    sigma_m: float
    """One sigma of the error; 0: the position is exact."""
    rates: tuple[float, ...]
    """Angular frequency w of each process, 1/s; 0: that part of the error is constant."""

    variance_each: float
    """Variance of each process, m^2."""
    rms_rate: float
    """Root mean square of the angular frequencies, 1/s."""

    quick_density: float
    """Density of a first-order error's rate with the same integral, m^2/s: the mean of sigma^2 w."""
    smooth_density: float
    """Density of the smooth error's acceleration, m^2/s^3: the mean of 4 sigma^2 w^3."""

    def apparent_noise(self, interval_s: float, variance: float, smooth_share: float) -> float:
        """Variance by which the apparent place moves within an interval, each axis, m^2.

        ``variance``: its own before; ``smooth_share``: probability that the error is a smooth one. The variance of a
        mixture is the mean of the variances. A first-order error moves by 2 sigma^2 (1 - correlation), with the
        correlation exp(-w t / 2).

        The filter of a random walk of density q looks back T = variance / q. A smooth error moves by rate T within
        that, so q = rate^2 T = rate sqrt(variance). Between sparse fixes it is the movement itself, 2 sigma^2 (1 -
        correlation).
        """
        if self.sigma_m == 0.0:
            return 0.0
        smooth = quick = 0.0
        for rate in self.rates:
            turn = rate * interval_s
            quick += 1.0 - exp(-0.5 * turn)
            smooth += 1.0 - (1.0 + turn) * exp(-turn)
        twice = 2.0 * self.variance_each
        smooth = max(twice * smooth, self.rms_rate * self.sigma_m * sqrt(variance) * interval_s)
        return smooth_share * smooth + (1.0 - smooth_share) * twice * quick


def position_wander(sigma_m: float, time_constants_s: Sequence[float]) -> PositionWander:
    """The error with this sigma, each process with the integral time of a first-order one with its time constant."""
    return wander_with_rates(sigma_m, [2.0 / time_s if 0.0 < time_s < inf else 0.0 for time_s in time_constants_s])


def wander_with_rates(sigma_m: float, rates: Sequence[float]) -> PositionWander:
    """The error with this sigma and these angular frequencies, 1/s."""
    each = sigma_m**2 / len(rates)
    return PositionWander(
        sigma_m,
        tuple(rates),
        variance_each=each,
        rms_rate=sqrt(sum(rate * rate for rate in rates) / len(rates)),
        quick_density=each * sum(rates),
        smooth_density=4.0 * each * sum(rate**3 for rate in rates),
    )


class WanderingPlace(msgspec.Struct, frozen=True, gc=False):
    """Place, errors of the vehicle's position and their rates; north and east of each, one covariance for both axes."""

    north: Column
    east: Column
    cov: tuple[Column, ...]
    shared: tuple[tuple[Row, ...], tuple[Row, ...]]
    """cov(state, b / sigma): the rows of all states for north, and those for east."""
    means: tuple[Mean, ...] = ()
    """The last three means of fixes, without a jump between them."""

    @property
    def estimate(self) -> PointEstimate:
        """The place with its covariance."""
        noise: Symmetric2 = (self.cov[0][0], 0.0, self.cov[0][0])
        return PointEstimate(self.north[0], self.east[0], noise, (self.shared[0][0], self.shared[1][0]))

    def update(
        self, apparent: PointEstimate, wander: PositionWander, interval_s: float, mean: PointEstimate
    ) -> WanderingPlace:
        """The state after the apparent place ``interval_s`` after the last one. ``mean``: of the same fixes."""
        steps = [_step(rate, interval_s) for rate in wander.rates]
        cov = _predicted(self.cov, steps, wander)
        by_apparent = [row[0] + sum(row[1::2]) for row in cov]
        # What the biases do changes with the geometry, too: taken for wander it would be extrapolated.
        north_variance, _, east_variance = apparent.cov
        noise = 0.5 * (north_variance + east_variance)
        scale = 1.0 / (by_apparent[0] + sum(by_apparent[1::2]) + noise)
        gains = [each * scale for each in by_apparent]
        rows = zip(apparent.shared, self.shared, strict=True)
        north, east = (_blended_rows(own, _moved_rows(of, steps), gains) for own, of in rows)
        return WanderingPlace(
            north=_blended(apparent.north_m, _moved(self.north, steps), gains),
            east=_blended(apparent.east_m, _moved(self.east, steps), gains),
            cov=tuple(
                tuple([p - gain * other for p, other in zip(row, by_apparent, strict=True)])
                for row, gain in zip(cov, gains, strict=True)
            ),
            shared=(north, east),
            means=with_mean(self.means, mean, interval_s),
        )

    def movement(self, wander: PositionWander, interval_s: float) -> tuple[float, float, float]:
        """The movement of the errors within the next interval as their rates foretell it, north and east, metres; its
        variance along each axis, m^2.

        With c the row of F - 1 that the errors sum up, it is c x. Its variance is that of the stationary processes,
        2 sigma^2 (1 - correlation), less what x shows of it, c (S - P) c'. The biases are in P.
        """
        row, variance, each = [0.0], 0.0, wander.variance_each
        for rate in wander.rates:
            decay = exp(-rate * interval_s)
            error, by_rate = decay * (1.0 + rate * interval_s) - 1.0, decay * interval_s
            row += (error, by_rate)
            variance -= each * (error * (2.0 + error) + (rate * by_rate) ** 2)
        for weight, column in zip(row, self.cov, strict=True):
            variance += weight * sum(map(mul, row, column))
        return sum(map(mul, row, self.north)), sum(map(mul, row, self.east)), max(0.0, variance)

    def with_jump(self, variance: float) -> WanderingPlace:
        """The state with the error free to have moved by ``variance``, m^2."""
        place, error, *others = self.cov
        jumped = (place, (error[0], error[1] + variance, *error[2:]), *others)
        return msgspec.structs.replace(self, cov=jumped, means=())

    def with_fresh_error(self, wander: PositionWander) -> WanderingPlace:
        """The state with an error of which nothing is known but the processes."""
        count, place_variance = 1 + 2 * len(wander.rates), self.cov[0][0]
        variances = (place_variance, *_prior_variances(wander))
        nothing = (0.0,) * len(self.shared[0][0])
        return WanderingPlace(
            north=(self.north[0], *(0.0,) * (count - 1)),
            east=(self.east[0], *(0.0,) * (count - 1)),
            cov=tuple(tuple(variances[i] if i == j else 0.0 for j in range(count)) for i in range(count)),
            shared=(
                (self.shared[0][0], *(nothing,) * (count - 1)),
                (self.shared[1][0], *(nothing,) * (count - 1)),
            ),
        )


def first_place_estimate(apparent: PointEstimate, wander: PositionWander) -> PointEstimate:
    """The place by one apparent place, as :func:`first_place` has it."""
    total = 0.5 * (apparent.noise[0] + apparent.noise[2]) + wander.sigma_m**2
    return PointEstimate(apparent.north_m, apparent.east_m, (total, 0.0, total), apparent.shared)


def first_place(apparent: PointEstimate, wander: PositionWander) -> WanderingPlace:
    """The state by one apparent place: the place there, and the error at its prior."""
    others, each = 2 * len(wander.rates), wander.variance_each
    nothing = (0.0,) * len(apparent.shared[0])
    variances = _prior_variances(wander)
    by_place = tuple(-each if i % 2 == 0 else 0.0 for i in range(others))
    total = 0.5 * (apparent.noise[0] + apparent.noise[2]) + wander.sigma_m**2
    rest = tuple((by_place[i], *(variances[i] if i == j else 0.0 for j in range(others))) for i in range(others))
    return WanderingPlace(
        north=(apparent.north_m, *(0.0,) * others),
        east=(apparent.east_m, *(0.0,) * others),
        cov=((total, *by_place), *rest),
        shared=((apparent.shared[0], *(nothing,) * others), (apparent.shared[1], *(nothing,) * others)),
    )


Step: TypeAlias = tuple[float, float, float, float]
"""Transition of one process: error by error and rate, rate by error and rate."""


def _step(rate: float, interval_s: float) -> Step:
    decay = exp(-rate * interval_s)
    return (
        decay * (1.0 + rate * interval_s),
        decay * interval_s,
        -decay * rate * rate * interval_s,
        decay * (1.0 - rate * interval_s),
    )


def _prior_variances(wander: PositionWander) -> tuple[float, ...]:
    """Variances of error and rate of each process."""
    each = wander.variance_each
    return tuple(variance for rate in wander.rates for variance in (each, each * rate * rate))


def _moved(column: Sequence[float], steps: Sequence[Step]) -> Column:
    """The transition applied to one column."""
    moved = [column[0]]
    for i, (ee, er, re, rr) in enumerate(steps):
        error, rate = column[2 * i + 1], column[2 * i + 2]
        moved += (ee * error + er * rate, re * error + rr * rate)
    return tuple(moved)


def _moved_rows(rows: tuple[Row, ...], steps: Sequence[Step]) -> tuple[Row, ...]:
    """The transition applied to the rows of C."""
    moved = [rows[0]]
    for i, (ee, er, re, rr) in enumerate(steps):
        both = list(zip(rows[2 * i + 1], rows[2 * i + 2], strict=True))
        moved += (tuple([ee * x + er * y for x, y in both]), tuple([re * x + rr * y for x, y in both]))
    return tuple(moved)


def _predicted(cov: tuple[Column, ...], steps: Sequence[Step], wander: PositionWander) -> list[Column]:
    """The predicted covariance: ``F (P - S) F' + S``, with S that of the stationary processes."""
    variances = (0.0, *_prior_variances(wander))
    rest = [[p - (variances[i] if i == j else 0.0) for j, p in enumerate(row)] for i, row in enumerate(cov)]
    half = [_moved(row, steps) for row in rest]
    moved = [_moved(column, steps) for column in zip(*half, strict=True)]
    return [tuple([p + (variances[i] if i == j else 0.0) for j, p in enumerate(row)]) for i, row in enumerate(moved)]


def _blended(apparent: float, column: Column, gains: Sequence[float]) -> Column:
    """The states of one axis after the apparent place by these gains."""
    off = apparent - column[0] - sum(column[1::2])
    return tuple([x + gain * off for x, gain in zip(column, gains, strict=True)])


def _blended_rows(apparent: Row, rows: tuple[Row, ...], gains: Sequence[float]) -> tuple[Row, ...]:
    """The same of the rows of C."""
    shown = [rows[0], *rows[1::2]]
    off = [a - sum(each) for a, each in zip(apparent, zip(*shown, strict=True), strict=True)]
    return tuple(
        tuple([x + gain * o for x, o in zip(row, off, strict=True)]) for row, gain in zip(rows, gains, strict=True)
    )
