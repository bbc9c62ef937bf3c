"""Schmidt-Kalman filter of a point on the ground: biases are considered, not estimated (Schmidt 1966).

With the error e of the estimate, noise covariance P and considered covariance C = cov(e, b / sigma), a fix with noise R
and scaled Jacobian J, in numpy::

    D = J - C
    S = P + R + D @ D.T
    K = (P - C @ D.T) @ inv(S)                           # minimises P + C @ C.T
    P = (I - K) @ P @ (I - K).T + K @ R @ K.T            # Joseph form (Bucy & Joseph 1968): right for any gain
    C = C + K @ D

tests/tracking/test_schmidt_kalman.py compares with this form. The height of the target has a scalar filter of its own,
with a gain from its noise alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, hypot
from operator import sub
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2, gram, inner
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import Measurement

Gain: TypeAlias = tuple[float, float, float, float]
"""K by rows: nn, ne, en, ee."""


def difference(of_fix: Sequence[Row], of_point: Sequence[Row]) -> tuple[Row, Row]:
    """D = J - C, north and east: the sensitivities of an innovation, metres per sigma of each bias."""
    return tuple(map(sub, of_fix[0], of_point[0])), tuple(map(sub, of_fix[1], of_point[1]))


class Innovation2(msgspec.Struct, frozen=True, gc=False):
    """Horizontal innovation, a fix minus the predicted point, with the covariances that a gain needs."""

    north_m: float
    east_m: float
    of_point: tuple[Row, Row]
    """C of the point, north and east, metres."""
    of_fix: tuple[Row, Row]
    """J: metres per sigma of each bias, north and east."""
    noise: Symmetric2
    """P + R, the covariance of the innovation without the biases, m^2."""
    cov: Symmetric2
    """S, the covariance of the innovation with the biases, m^2."""
    weighed: Gain
    """P - C D', the covariance of the point's error with the innovation, m^2: the gain times S."""
    before: Symmetric2
    """P + C C', the covariance of the point with the biases, m^2."""

    @property
    def shared(self) -> tuple[Row, Row]:
        """D = J - C: metres per sigma of each bias, north and east."""
        return difference(self.of_fix, self.of_point)

    @property
    def gain(self) -> Gain:
        """K = (P - C D') inv(S): the gain of least total covariance, noise and considered biases together."""
        return gain_of(self.weighed, self.cov)


class PointEstimate(msgspec.Struct, frozen=True, gc=False):
    """Horizontal estimate of a point, with its covariance due to noise and due to considered biases."""

    north_m: float
    east_m: float
    noise: Symmetric2
    """P, the covariance due to noise, m^2."""
    shared: tuple[Row, Row]
    """C: cov(error, b / sigma), metres."""

    @property
    def cov(self) -> Symmetric2:
        """Covariance P + C C', all sources of error included, m^2."""
        (nn, ne, ee), (by_nn, by_ne, by_ee) = self.noise, gram(*self.shared)
        return (nn + by_nn, ne + by_ne, ee + by_ee)

    def with_noise(self, more: Symmetric2) -> PointEstimate:
        """The estimate with the noise covariance increased by ``more``, m^2."""
        (nn, ne, ee), (more_nn, more_ne, more_ee) = self.noise, more
        return PointEstimate(self.north_m, self.east_m, (nn + more_nn, ne + more_ne, ee + more_ee), self.shared)

    def moved(self, north_m: float, east_m: float, variance: float) -> PointEstimate:
        """The estimate after a movement with this variance along each axis, m^2."""
        (nn, ne, ee), shared = self.noise, self.shared
        return PointEstimate(self.north_m + north_m, self.east_m + east_m, (nn + variance, ne, ee + variance), shared)

    def innovation(self, fix: Measurement) -> Innovation2:
        """The innovation of a fix, and its covariances.

        All inner products, also those of D = J - C, come from lengths and distances of the rows, as in ``inner``.
        """
        (j_n, j_e, _), (c_n, c_e) = fix.shared, self.shared
        j_nn, j_ee, c_nn, c_ee = hypot(*j_n) ** 2, hypot(*j_e) ** 2, hypot(*c_n) ** 2, hypot(*c_e) ** 2
        j_ne, c_ne = dist(j_n, j_e) ** 2, dist(c_n, c_e) ** 2
        nn, ne, en, ee = dist(c_n, j_n) ** 2, dist(c_n, j_e) ** 2, dist(c_e, j_n) ** 2, dist(c_e, j_e) ** 2
        (p_nn, p_ne, p_ee), ((r_nn, r_ne, _), (_, r_ee, _), _) = self.noise, fix.noise
        noise = (p_nn + r_nn, p_ne + r_ne, p_ee + r_ee)
        north, east, _ = fix.position
        return Innovation2(
            north - self.north_m,
            east - self.east_m,
            self.shared,
            (j_n, j_e),
            noise,
            (noise[0] + nn, noise[1] + 0.5 * (ne + en - j_ne - c_ne), noise[2] + ee),
            (
                p_nn - 0.5 * (j_nn - c_nn - nn),
                p_ne - 0.5 * (j_ee - c_ee - ne + c_ne),
                p_ne - 0.5 * (j_nn - c_nn - en + c_ne),
                p_ee - 0.5 * (j_ee - c_ee - ee),
            ),
            (p_nn + c_nn, p_ne + 0.5 * (c_nn + c_ee - c_ne), p_ee + c_ee),
        )

    def along(self, row: Row) -> tuple[float, float]:
        """Covariance with another error due to the biases, north and east, m^2: C times the ``row`` of that error."""
        if not any(row):  # on level ground no bias moves a point up or down
            return 0.0, 0.0
        return inner(self.shared[0], row), inner(self.shared[1], row)

    def update(self, innovation: Innovation2, gain: Gain) -> PointEstimate:
        """The estimate after an update with any gain, in Joseph form.

        P - K P - P K' + K (P + R) K' is P - K M' - M K' with M = P - K (P + R) / 2.
        """
        (a, b, c, d), (nn, ne, ee), (s_nn, s_ne, s_ee) = gain, self.noise, innovation.noise
        (c_n, c_e), (j_n, j_e) = self.shared, innovation.of_fix
        n, e = innovation.north_m, innovation.east_m
        m_nn, m_ne = nn - 0.5 * (a * s_nn + b * s_ne), ne - 0.5 * (a * s_ne + b * s_ee)
        m_en, m_ee = ne - 0.5 * (c * s_nn + d * s_ne), ee - 0.5 * (c * s_ne + d * s_ee)
        north, east = [], []
        for x, y, j_x, j_y in zip(c_n, c_e, j_n, j_e, strict=True):
            d_x, d_y = j_x - x, j_y - y
            north.append(x + a * d_x + b * d_y)
            east.append(y + c * d_x + d * d_y)
        return PointEstimate(
            self.north_m + a * n + b * e,
            self.east_m + c * n + d * e,
            (
                nn - 2.0 * (a * m_nn + b * m_ne),
                ne - a * m_en - b * m_ee - c * m_nn - d * m_ne,
                ee - 2.0 * (c * m_en + d * m_ee),
            ),
            (tuple(north), tuple(east)),
        )

    def mixed(self, fix: Measurement, noise: Matrix3, share: float) -> PointEstimate:
        """The estimate after an update with the gain ``share`` along either axis. ``noise``: R, m^2."""
        (nn, ne, ee), ((r_nn, r_ne, _), (_, r_ee, _), _) = self.noise, noise
        kept2, share2, north, east = (1.0 - share) ** 2, share * share, [], []
        for x, y, j_x, j_y in zip(*self.shared, *fix.shared[:2], strict=True):
            north.append(x + share * (j_x - x))
            east.append(y + share * (j_y - y))
        return PointEstimate(
            self.north_m + share * (fix.position[0] - self.north_m),
            self.east_m + share * (fix.position[1] - self.east_m),
            (kept2 * nn + share2 * r_nn, kept2 * ne + share2 * r_ne, kept2 * ee + share2 * r_ee),
            (tuple(north), tuple(east)),
        )


class DownEstimate(msgspec.Struct, frozen=True, gc=False):
    """Estimate of the target's height, by a scalar filter of its own."""

    down_m: float
    variance: float
    """Variance by noise, m^2."""
    shared: Row
    """cov(error, b / sigma), metres."""

    def update(self, fix: Measurement, gain: float | None = None) -> DownEstimate:
        """The estimate after one more fix. The default gain minimises the noise."""
        noise = fix.noise[2][2]
        if gain is None:
            gain = self.variance / (self.variance + noise)
        shared = self.shared
        if any(shared) or any(fix.shared[2]):  # on level ground no bias moves a point up or down
            shared = tuple([c + gain * (j - c) for c, j in zip(shared, fix.shared[2], strict=True)])
        down_m = self.down_m + gain * (fix.position[2] - self.down_m)
        variance = (1.0 - gain) ** 2 * self.variance + gain * gain * noise
        return DownEstimate(down_m, variance, shared)


def first_point_estimate(fix: Measurement, noise: Matrix3 | None = None) -> PointEstimate:
    """The estimate after a first fix: the fix itself. ``noise``: R, m^2, if it differs from the noise of ``fix``."""
    (nn, ne, _), (_, ee, _), _ = noise or fix.noise
    return PointEstimate(fix.position[0], fix.position[1], (nn, ne, ee), fix.shared[:2])


def first_down(fix: Measurement) -> DownEstimate:
    """The height after a first fix."""
    return DownEstimate(fix.position[2], fix.noise[2][2], fix.shared[2])


def gain_of(weighed: Gain, cov: Symmetric2) -> Gain:
    """The gain: covariance of an error with an innovation, times the inverse of the innovation's covariance."""
    (a, b, c, d), (nn, ne, ee) = weighed, cov
    scale = 1.0 / (nn * ee - ne * ne)
    i_nn, i_ne, i_ee = ee * scale, -ne * scale, nn * scale
    return (a * i_nn + b * i_ne, a * i_ne + b * i_ee, c * i_nn + d * i_ne, c * i_ne + d * i_ee)


def scattered(estimate: PointEstimate, scatter: AdaptiveNoise, fix: Measurement, timed: int | None) -> AdaptiveNoise:
    """The adaptive noise after one more fix."""
    north_m, east_m = fix.position[0] - estimate.north_m, fix.position[1] - estimate.east_m
    (p_nn, _, p_ee), ((r_nn, _, _), (_, r_ee, _), _) = estimate.noise, fix.noise
    thrown2 = 0.0 if timed is None else fix.shared[0][timed] ** 2 + fix.shared[1][timed] ** 2
    return scatter.with_fix(north_m * north_m + east_m * east_m, p_nn + p_ee + r_nn + r_ee, thrown2)
