"""Estimation of the target's place and of the error of the vehicle's position, from the apparent place of the fixes.

The apparent place is the place plus the present error of the vehicle's position. That error is modelled as a sum of
critically damped second-order Gauss-Markov processes (Gelb 1974, ch. 2), because receivers' errors move smoothly. With
the same sigma and time constant (1 m, 60 s) a first-order process would move by 0.18 m within a second, this one by
0.03 m. Its correlation is ``sigma^2 (1 + w t) exp(-w t)``; the integral is that of a first-order process with the time
constant ``2 / w``.

Where the time constant is not known, the error is a sum of several processes. The mean of their correlations is the
correlation of an error whose time constant is drawn among theirs, so the covariance is right in the mean over
receivers.

Not every error is smooth. As far as the fixes show a first-order error (``wander_evidence``), the apparent place is
predicted with that. The covariance of the place hardly depends on the kind: both have the same integral.

The apparent place is filtered at every fix. Place, errors and rates are updated once a second, by one scalar Kalman
filter for both axes: the wander is the same along each, and the fixes' covariances differ little between the axes in
comparison.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import exp, inf, sqrt
from operator import mul
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.small_matrices import Row, diagonal, plus_diagonal
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate
from fwav_companion.tracking.filters.wander_evidence import Mean, with_mean

Table: TypeAlias = tuple[Row, ...]
"""A row for each state: the place, then error and rate of each process."""


class PositionWander(msgspec.Struct, frozen=True, gc=False):
    """Model of the vehicle's position error along each horizontal axis: a sum of processes of equal variance."""

    sigma_m: float
    """One sigma of the error; 0: the position is exact."""
    rates: tuple[float, ...]
    """Angular frequency w of each process, 1/s; 0: that part of the error is constant."""

    variance_each: float
    """Variance of each process, m^2."""
    rms_rate: float
    """Root mean square of the angular frequencies, 1/s."""

    quick_density: float
    """Spectral density of the rate of a first-order error with the same integral, m^2/s: the mean of sigma^2 w."""
    smooth_density: float
    """Spectral density of the smooth error's acceleration, m^2/s^3: the mean of 4 sigma^2 w^3."""

    @property
    def is_constant(self) -> bool:
        """Whether the error has no time constant: it changes only where its sigma grows, as a drift does."""
        return not any(self.rates)

    @property
    def prior_variances(self) -> tuple[float, ...]:
        """Variances of error and rate of each process, m^2 and (m/s)^2."""
        each = self.variance_each
        return tuple([variance for rate in self.rates for variance in (each, each * rate * rate)])

    def apparent_noise(self, interval_s: float, variance: float, smooth_share: float) -> float:
        """Process noise of the apparent place over an interval: variance of each axis, m^2.

        ``variance``: of the apparent place before; ``smooth_share``: probability that the error is smooth. The variance
        of a mixture is the mean of the variances. The movement of a first-order error has the variance 2 sigma^2 (1 -
        correlation), with the correlation exp(-w t / 2).

        The filter of a random walk of density q averages over T = variance / q. A smooth error moves by rate T within
        that time, so q = rate^2 T = rate sqrt(variance). Between sparse fixes the process noise is the movement itself,
        2 sigma^2 (1 - correlation).
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


@lru_cache(maxsize=4)
def position_wander(sigma_m: float, time_constants_s: tuple[float, ...]) -> PositionWander:
    """The model with this sigma; each process has the integral time of a first-order one with its time constant.

    Cached, because a receiver reports the same sigma at many fixes.
    """
    rates = tuple([2.0 / time_s if 0.0 < time_s < inf else 0.0 for time_s in time_constants_s])
    each = sigma_m**2 / len(rates)
    return PositionWander(
        sigma_m,
        rates,
        variance_each=each,
        rms_rate=sqrt(sum(rate * rate for rate in rates) / len(rates)),
        quick_density=each * sum(rates),
        smooth_density=4.0 * each * sum(rate**3 for rate in rates),
    )


class WanderingPlace(msgspec.Struct, frozen=True, gc=False):
    """Estimate of place, errors of the vehicle's position and their rates; both axes have the same covariance."""

    north: Table
    """Mean of each state, metres and m/s, followed by its cov(state, b / sigma) with each bias."""
    east: Table
    cov: Table
    means: tuple[Mean, ...] = ()
    """The last three means of one second of fixes, without a jump between them."""

    @property
    def estimate(self) -> PointEstimate:
        """The place with its covariance."""
        north, east, variance = self.north[0], self.east[0], self.cov[0][0]
        return PointEstimate(north[0], east[0], (variance, 0.0, variance), (north[1:], east[1:]))

    def update(
        self, apparent: PointEstimate, wander: PositionWander, interval_s: float, mean: PointEstimate
    ) -> WanderingPlace:
        """The state after the next apparent place, ``interval_s`` after the last. ``mean``: mean of the same fixes."""
        steps = [process_step(rate, interval_s) for rate in wander.rates]
        cov = _predicted(self.cov, steps, wander)
        by_apparent = _apparent(cov)
        # The effect of the biases changes with the geometry, too: taken for wander it would be extrapolated.
        north_variance, _, east_variance = apparent.cov
        scale = 1.0 / (by_apparent[0] + sum(by_apparent[1::2]) + 0.5 * (north_variance + east_variance))
        gains = [each * scale for each in by_apparent]
        shared_n, shared_e = apparent.shared
        return WanderingPlace(
            _blended((apparent.north_m, *shared_n), _moved(self.north, steps), gains),
            _blended((apparent.east_m, *shared_e), _moved(self.east, steps), gains),
            _blended((0.0,) * len(cov), cov, gains),
            with_mean(self.means, mean, interval_s),
        )

    def movement(self, wander: PositionWander, interval_s: float) -> tuple[float, float, float]:
        """Predicted movement of the errors within the next interval, north and east, metres; its variance along each
        axis, m^2.

        With c the sum of the errors' rows of F - 1, the movement is c x. Its variance is that of the stationary
        processes, 2 sigma^2 (1 - correlation), minus the part that x shows, c (S - P) c'. P includes the biases.
        """
        row, variance, each = [0.0], 0.0, wander.variance_each
        for rate in wander.rates:
            decay = exp(-rate * interval_s)
            error, by_rate = decay * (1.0 + rate * interval_s) - 1.0, decay * interval_s
            row += (error, by_rate)
            variance -= each * (error * (2.0 + error) + (rate * by_rate) ** 2)
        north_m = east_m = 0.0
        for weight, of_north, of_east, cov in zip(row, self.north, self.east, self.cov, strict=True):
            north_m, east_m = north_m + weight * of_north[0], east_m + weight * of_east[0]
            variance += weight * sum(map(mul, row, cov))
        return north_m, east_m, max(0.0, variance)

    def with_jump(self, variance: float) -> WanderingPlace:
        """The state after a jump of the vehicle's position: the error's variance grows by ``variance``, m^2."""
        return msgspec.structs.replace(self.with_drift(variance), means=())

    def with_drift(self, variance: float) -> WanderingPlace:
        """The state after a drift of the vehicle's position, whose error's variance grows by ``variance``, m^2."""
        place, error, *others = self.cov
        return msgspec.structs.replace(self, cov=(place, (error[0], error[1] + variance, *error[2:]), *others))

    def with_shifted_frame(self, variance: float) -> WanderingPlace:
        """The state in a frame that is shifted by an unknown amount: the place errs by it, the error oppositely."""
        place, error, *others = self.cov
        shifted = (
            (place[0] + variance, place[1] - variance, *place[2:]),
            (error[0] - variance, error[1] + variance, *error[2:]),
        )
        return msgspec.structs.replace(self, cov=(*shifted, *others), means=())

    def with_processes(self, wander: PositionWander) -> WanderingPlace:
        """The state with the processes of another model of the error: its mean and covariances with the place stay.

        From a sum of processes to one constant error the processes are added up, and their rates end. The other way the
        error is shared evenly: each process has its prior variance, and as much covariance with the place as that
        allows.
        """
        total = (self._summed(self.north), self._summed(self.east), self._summed(self.cov))
        place_error, variance = total[2][0], self._summed_cov()
        count = len(wander.rates)
        if wander.is_constant:
            cov: Table = ((self.cov[0][0], place_error, 0.0), (place_error, variance, 0.0), (0.0, 0.0, 0.0))
            each: Row = (1.0,)
        else:
            fits = min(1.0, wander.sigma_m / sqrt(variance)) if variance > 0.0 else 0.0
            cov = _with_errors(self.cov[0][0], wander.prior_variances, fits * place_error / count)
            each = (1.0 / count,) * count
        nothing = (0.0,) * len(self.north[0])
        north, east = (
            (table[0], *[row for share in each for row in (tuple([share * x for x in error]), nothing)])
            for table, error in ((self.north, total[0]), (self.east, total[1]))
        )
        return WanderingPlace(north, east, cov, self.means)

    @staticmethod
    def _summed(table: Table) -> Row:
        """Sum of the errors' rows."""
        return tuple([sum(column) for column in zip(*table[1::2], strict=True)])

    def _summed_cov(self) -> float:
        """Variance of the sum of the errors, m^2."""
        return sum(sum(row[1::2]) for row in self.cov[1::2])

    def with_fresh_error(self, wander: PositionWander) -> WanderingPlace:
        """The state with a new error of the vehicle's position, at the prior of its processes."""
        return _with_prior_errors(self.estimate, wander, 0.0)


def first_place_estimate(apparent: PointEstimate, wander: PositionWander) -> PointEstimate:
    """Estimate of the place from one apparent place, as in :func:`first_place`."""
    total = 0.5 * (apparent.noise[0] + apparent.noise[2]) + wander.sigma_m**2
    return PointEstimate(apparent.north_m, apparent.east_m, (total, 0.0, total), apparent.shared)


def first_place(apparent: PointEstimate, wander: PositionWander) -> WanderingPlace:
    """The state after one apparent place: the place is there, and the error at its prior."""
    return _with_prior_errors(first_place_estimate(apparent, wander), wander, -wander.variance_each)


def _with_prior_errors(place: PointEstimate, wander: PositionWander, by_error: float) -> WanderingPlace:
    """The state of a place, with the errors at their priors. ``by_error``: covariance of place and each error, m^2."""
    variances = wander.prior_variances
    nothing = (0.0,) * (1 + len(place.shared[0]))
    shared_n, shared_e = place.shared
    return WanderingPlace(
        north=((place.north_m, *shared_n), *[nothing] * len(variances)),
        east=((place.east_m, *shared_e), *[nothing] * len(variances)),
        cov=_with_errors(place.noise[0], variances, by_error),
    )


def _with_errors(place: float, variances: Sequence[float], by_error: float) -> Table:
    """Covariance of a place and independent errors and rates. ``by_error``: covariance of place and each error, m^2."""
    by_errors = (by_error, 0.0) * (len(variances) // 2)
    errors = diagonal(variances)
    return ((place, *by_errors), *[(by, *row) for by, row in zip(by_errors, errors, strict=True)])


Step: TypeAlias = tuple[float, float, float, float]
"""Transition matrix of one process by rows: error from error and rate, rate from error and rate."""


def process_step(rate: float, interval_s: float) -> Step:
    """The transition of a critically damped process of this angular frequency, 1/s."""
    decay = exp(-rate * interval_s)
    return (
        decay * (1.0 + rate * interval_s),
        decay * interval_s,
        -decay * rate * rate * interval_s,
        decay * (1.0 - rate * interval_s),
    )


def _moved(rows: Sequence[Row], steps: Sequence[Step]) -> Table:
    """The transition applied to a table."""
    moved = [rows[0]]
    for i, (ee, er, re, rr) in enumerate(steps):
        both = list(zip(rows[2 * i + 1], rows[2 * i + 2], strict=True))
        moved += (tuple([ee * x + er * y for x, y in both]), tuple([re * x + rr * y for x, y in both]))
    return tuple(moved)


def _predicted(cov: Table, steps: Sequence[Step], wander: PositionWander) -> Table:
    """The predicted covariance: ``F (P - S) F' + S``, with the covariance S of the stationary processes."""
    variances = (0.0, *wander.prior_variances)
    half = _moved(plus_diagonal(cov, [-each for each in variances]), steps)
    return plus_diagonal(_moved(list(zip(*half, strict=True)), steps), variances)


def _apparent(rows: Table) -> Row:
    """Row of the apparent place in a table: the place plus the error of each process."""
    return tuple([sum(each) for each in zip(rows[0], *rows[1::2], strict=True)])


def _blended(apparent: Row, rows: Table, gains: Sequence[float]) -> Table:
    """A table updated with the apparent place and these gains: ``X + K (z - H X)``, with z = 0 for the covariance."""
    off = [measured - expected for measured, expected in zip(apparent, _apparent(rows), strict=True)]
    return tuple(
        [tuple([x + gain * o for x, o in zip(row, off, strict=True)]) for row, gain in zip(rows, gains, strict=True)]
    )
