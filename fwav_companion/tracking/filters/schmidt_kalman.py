"""Schmidt-Kalman filter of a standing target: two answers, and biases that are considered (Schmidt 1966).

States, each north and east: the *apparent* place, which is the target in the frame of the vehicle's own reports; the
target's *place*; and the rate of the vehicle's position error. The apparent place is the place plus that error: fixes
measure it directly, and a drifting position moves it. Where positions are exact the two are one, and the rest is left
out.

With the errors e of the states, noise covariance P, considered covariance C = cov(e, b / sigma), a fix with noise R and
scaled Jacobian J, and H that picks the apparent place, in numpy::

    D = J - H @ C
    S = H @ P @ H.T + R + D @ D.T
    K = (P @ H.T - C @ D.T) @ inv(S)                     # minimises P + C @ C.T
    P = (I - K @ H) @ P @ (I - K @ H).T + K @ R @ K.T    # Joseph form (Bucy & Joseph 1968): right for any gain
    C = C + K @ D

tests/tracking/test_schmidt_kalman.py compares with this form. The height of the target is a filter of its own, with the
gain of its noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, hypot, log
from operator import sub
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.small_matrices import Symmetric2, inner
from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import BiasShare, Measurement, Row
from fwav_companion.tracking.filters.position_wander import PositionWander
from fwav_companion.types.tracks import OUTSIDE_GATE, GateResult

Gain: TypeAlias = tuple[tuple[float, float], ...]
"""A row of two for each state."""


class FixInnovation(msgspec.Struct, frozen=True, gc=False):
    """A fix minus the predicted apparent place."""

    north_m: float
    east_m: float
    shared: tuple[Row, Row]
    """D = J - H C: metres per sigma of each bias, north and east."""
    noise: Symmetric2
    """H P H' + R, m^2."""
    cov: Symmetric2
    """S: with the biases, m^2."""


class DownEstimate(msgspec.Struct, frozen=True, gc=False):
    """Height of the target: its own scalar filter."""

    down_m: float
    variance: float
    """Variance by noise, m^2."""
    shared: Row
    """cov(error, b / sigma), metres."""

    def update(self, fix: Measurement, gain: float | None = None) -> DownEstimate:
        """The estimate with one more fix, by the gain of least noise unless another is given."""
        noise = fix.noise[2][2]
        if gain is None:
            gain = self.variance / (self.variance + noise)
        shared = self.shared
        if any(shared) or any(fix.shared[2]):  # on level ground no bias moves a point up or down
            shared = tuple([c + gain * (j - c) for c, j in zip(shared, fix.shared[2], strict=True)])
        down_m = self.down_m + gain * (fix.position[2] - self.down_m)
        variance = (1.0 - gain) ** 2 * self.variance + gain * gain * noise
        return DownEstimate(down_m, variance, shared)


class PlaceEstimate(msgspec.Struct, frozen=True, gc=False):
    """Two horizontal coordinates, and their error by noise and by considered biases."""

    north_m: float
    east_m: float
    noise: Symmetric2
    """Covariance by noise, m^2."""
    shared: tuple[Row, Row]
    """cov(error, b / sigma), metres."""

    @property
    def cov(self) -> Symmetric2:
        """Covariance by every source, m^2."""
        (nn, ne, ee), (n, e) = self.noise, self.shared
        return (nn + inner(n, n), ne + inner(n, e), ee + inner(e, e))


class StandingEstimate(msgspec.Struct, frozen=True, gc=False):
    """The states of one target and their errors."""

    mean: Row
    """Apparent north and east, place north and east, metres; rate north and east, m/s. Only the first two where
    positions are exact."""
    noise: tuple[Row, ...]
    """Covariance P of the states by noise and by the wander of the position."""
    shared: tuple[Row, ...]
    """Rows of C, a row for each state."""

    @property
    def apparent(self) -> PlaceEstimate:
        """The place in the frame of the vehicle's reports."""
        return self._pair(0)

    @property
    def place(self) -> PlaceEstimate:
        """The target's place."""
        return self._pair(2 if len(self.mean) > 2 else 0)

    def _pair(self, i: int) -> PlaceEstimate:
        noise = (self.noise[i][i], self.noise[i][i + 1], self.noise[i + 1][i + 1])
        return PlaceEstimate(self.mean[i], self.mean[i + 1], noise, (self.shared[i], self.shared[i + 1]))

    def predict(self, wander: PositionWander, interval_s: float) -> StandingEstimate:
        """The estimate a while later: the target stays, the position error wanders on."""
        if len(self.mean) == 2:
            return self
        step = wander.step(interval_s)
        ee, er, re, rr = step.error_error, step.error_rate, step.rate_error, step.rate_rate
        rest = 1.0 - ee
        blocks = ((ee, rest, er), (0.0, 1.0, 0.0), (re, -re, rr))

        def moved(rows: Sequence[Row]) -> list[Row]:
            apparent_n, apparent_e, place_n, place_e, rate_n, rate_e = rows
            return [
                tuple([a * x + b * y + c * z for x, y, z in zip(*columns, strict=True)])
                for a, b, c in blocks
                for columns in ((apparent_n, place_n, rate_n), (apparent_e, place_e, rate_e))
            ]

        half = moved(self.noise)
        noise = [list(row) for row in zip(*moved(list(zip(*half, strict=True))), strict=True)]
        for axis in (0, 1):
            noise[axis][axis] += step.error_variance
            noise[axis][axis + 4] += step.cross_variance
            noise[axis + 4][axis] += step.cross_variance
            noise[axis + 4][axis + 4] += step.rate_variance
        mean = tuple(value for (value,) in moved([(value,) for value in self.mean]))
        return StandingEstimate(mean, tuple(map(tuple, noise)), tuple(moved(self.shared)))

    def with_jump(self, jump: Symmetric2, per_s: float) -> StandingEstimate:
        """The estimate with the vehicle's position error free to have moved by ``jump``, m^2, at ``per_s`` of it."""
        if len(self.mean) == 2:
            return self
        nn, ne, ee = jump
        noise = [list(row) for row in self.noise]
        for i, j, factor in ((0, 0, 1.0), (0, 4, per_s), (4, 0, per_s), (4, 4, per_s * per_s)):
            noise[i][j] += factor * nn
            noise[i][j + 1] += factor * ne
            noise[i + 1][j] += factor * ne
            noise[i + 1][j + 1] += factor * ee
        return StandingEstimate(self.mean, tuple(map(tuple, noise)), self.shared)

    def innovation(self, fix: Measurement) -> FixInnovation:
        """The innovation of a fix, and its covariance."""
        d_n = tuple(map(sub, fix.shared[0], self.shared[0]))
        d_e = tuple(map(sub, fix.shared[1], self.shared[1]))
        (r_nn, r_ne, _), (_, r_ee, _), _ = fix.noise
        nn, ne, ee = self.noise[0][0] + r_nn, self.noise[0][1] + r_ne, self.noise[1][1] + r_ee
        return FixInnovation(
            fix.position[0] - self.mean[0],
            fix.position[1] - self.mean[1],
            (d_n, d_e),
            (nn, ne, ee),
            (nn + inner(d_n, d_n), ne + inner(d_n, d_e), ee + inner(d_e, d_e)),
        )

    def kalman_gain(self, innovation: FixInnovation) -> Gain:
        """K = (P H' - C D') inv(S): the gain of least total covariance, noise and considered biases together."""
        (s_nn, s_ne, s_ee), (d_n, d_e) = innovation.cov, innovation.shared
        scale = 1.0 / (s_nn * s_ee - s_ne * s_ne)
        i_nn, i_ne, i_ee = s_ee * scale, -s_ne * scale, s_nn * scale
        gain = []
        for noise, shared in zip(self.noise, self.shared, strict=True):
            n, e = noise[0] - inner(shared, d_n), noise[1] - inner(shared, d_e)
            gain.append((n * i_nn + e * i_ne, n * i_ne + e * i_ee))
        return tuple(gain)

    def update(self, innovation: FixInnovation, gain: Gain) -> StandingEstimate:
        """The estimate after a fix by any gain, in Joseph's form.

        P - K G' - G K' + K S K', with G = P H' and the noise part of S, is P - K M' - M K' with M = G - K S / 2.
        """
        (d_n, d_e), (s_nn, s_ne, s_ee) = innovation.shared, innovation.noise
        rows = [
            (row, a, b, row[0] - 0.5 * (a * s_nn + b * s_ne), row[1] - 0.5 * (a * s_ne + b * s_ee))
            for row, (a, b) in zip(self.noise, gain, strict=True)
        ]
        n_m, e_m = innovation.north_m, innovation.east_m
        return StandingEstimate(
            tuple([value + a * n_m + b * e_m for value, (a, b) in zip(self.mean, gain, strict=True)]),
            tuple(
                [
                    tuple([p - a * x - b * y - u * c - v * d for p, (_, c, d, x, y) in zip(row, rows, strict=True)])
                    for row, a, b, u, v in rows
                ]
            ),
            tuple(
                [
                    tuple([c + a * x + b * y for c, x, y in zip(row, d_n, d_e, strict=True)])
                    for row, (a, b) in zip(self.shared, gain, strict=True)
                ]
            ),
        )


def first_estimate(fix: Measurement, wander: PositionWander) -> StandingEstimate:
    """The estimate after a first fix: the fix itself, and the position error at its prior."""
    north, east, _ = fix.position
    (nn, ne, _), (_, ee, _), _ = fix.noise
    j_n, j_e, _ = fix.shared
    if wander.sigma_m == 0.0:
        return StandingEstimate((north, east), ((nn, ne), (ne, ee)), (j_n, j_e))
    far, rate, none = wander.sigma_m**2, wander.rate_variance, (0.0,) * len(j_n)
    return StandingEstimate(
        (north, east, north, east, 0.0, 0.0),
        (
            (nn, ne, nn, ne, 0.0, 0.0),
            (ne, ee, ne, ee, 0.0, 0.0),
            (nn, ne, nn + far, ne, 0.0, 0.0),
            (ne, ee, ne, ee + far, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, rate, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, rate),
        ),
        (j_n, j_e, j_n, j_e, none, none),
    )


def first_down(fix: Measurement) -> DownEstimate:
    """The height after a first fix."""
    return DownEstimate(fix.position[2], fix.noise[2][2], fix.shared[2])


def relative_estimate(
    before: StandingEstimate, innovation: FixInnovation, position_noise_m2: float, by_delay: BiasShare | None
) -> PlaceEstimate:
    """The target in the frame of the vehicle's report *at this fix*, whose noise and delay the fix shares.

    An update of the apparent place of this instant alone. Its prior is wider by the noise of one position, which is no
    noise of the fix then; and what the position delay does to the fix, it does to the report.
    """
    apparent = before.apparent
    nn, ne, ee = apparent.noise
    north, east = apparent.shared
    if by_delay is not None:
        i, by_north, by_east = by_delay
        north = (*north[:i], north[i] - by_north, *north[i + 1 :])
        east = (*east[:i], east[i] - by_east, *east[i + 1 :])
    noise = ((nn + position_noise_m2, ne), (ne, ee + position_noise_m2))
    now = StandingEstimate((apparent.north_m, apparent.east_m), noise, (north, east))
    return now.update(innovation, now.kalman_gain(innovation)).apparent


def gate_result(apparent: PlaceEstimate, scatter: AdaptiveNoise, fix: Measurement, timed: int | None) -> GateResult:
    """Gating statistics of a fix; errors that it shares with the estimate cancel."""
    (fix_n, fix_e, _), (own_n, own_e) = fix.shared, apparent.shared
    p_nn, p_ne, p_ee = apparent.noise
    (f_nn, f_ne, _), (_, f_ee, _), _ = fix.noise
    nn = p_nn + f_nn + scatter.variance + dist(fix_n, own_n) ** 2
    ee = p_ee + f_ee + scatter.variance + dist(fix_e, own_e) ** 2
    n, e = fix.position[0] - apparent.north_m, fix.position[1] - apparent.east_m
    if n * n > fix.gate * nn or e * e > fix.gate * ee:  # the distance along either axis is a lower bound
        return OUTSIDE_GATE
    ne = p_ne + f_ne + inner(map(sub, fix_n, own_n), map(sub, fix_e, own_e))
    if timed is not None:
        certain = 1.0 - scatter.doubt
        north, east = fix_n[timed] - own_n[timed], fix_e[timed] - own_e[timed]
        nn, ne, ee = nn - certain * north * north, ne - certain * north * east, ee - certain * east * east
    area2 = nn * ee - ne * ne
    return GateResult((ee * n * n - 2.0 * ne * n * e + nn * e * e) / area2, log(area2 / (f_nn * f_ee - f_ne * f_ne)))


def scattered(apparent: PlaceEstimate, scatter: AdaptiveNoise, fix: Measurement, timed: int | None) -> AdaptiveNoise:
    """The adaptive noise after one more fix."""
    distance = hypot(fix.position[0] - apparent.north_m, fix.position[1] - apparent.east_m)
    p_nn, _, p_ee = apparent.noise
    thrown2 = 0.0 if timed is None else fix.shared[0][timed] ** 2 + fix.shared[1][timed] ** 2
    return scatter.with_fix(distance * distance, p_nn + p_ee + fix.noise[0][0] + fix.noise[1][1], thrown2)
