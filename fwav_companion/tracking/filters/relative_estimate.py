"""Estimate of a target relative to the vehicle at one fix, from this fix and all earlier ones.

An error of the vehicle's reported position moves a target and the report alike, so relative to the report it cancels.
"""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2, inner
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.tracking.filters.consider_biases import BiasShare
from fwav_companion.tracking.filters.schmidt_kalman import Gain, Innovation2, PointEstimate, gain_of


class RelativeEstimate(msgspec.Struct, frozen=True, gc=False):
    """Position of a target in the frame of the vehicle's report at one fix."""

    north_m: float
    east_m: float
    cov: Symmetric2
    """Covariance, all sources of error included, m^2."""
    down_cov: tuple[float, float]
    """Covariance of north and east with the height of the target, due to the biases, m^2."""


def relative_estimate(
    before: PointEstimate,
    innovation: Innovation2,
    fix_noise: Matrix3,
    *,
    position_noise_m2: float,
    by_delay: BiasShare | None,
    down: Row,
) -> RelativeEstimate:
    """The target in the frame of the vehicle's report *at this fix*, whose noise and delay the fix shares.

    The update is of this instant alone. In that frame the noise r of one position is in the target and not in the fix,
    and the effect d of the position delay on the report is subtracted from both. The innovation is the same. Only its
    covariance with the target's error (+ r + d D') and the covariance of the target (+ r - d C' - C d' + d d') change;
    D and C are the columns of the delay. ``fix_noise``: R of this fix alone, because R of the innovation is inflated
    for time correlation; ``down``: C of the height. An update of all rows would double the time of a fix.
    """
    (a, b, c, d), (nn, ne, ee), (s_nn, s_ne, s_ee) = innovation.weighed, innovation.before, innovation.cov
    a, d, nn, ee = a + position_noise_m2, d + position_noise_m2, nn + position_noise_m2, ee + position_noise_m2
    if by_delay is not None:
        i, n, e = by_delay
        (of_point_n, of_point_e), (of_fix_n, of_fix_e) = innovation.of_point, innovation.of_fix
        c_n, c_e = of_point_n[i], of_point_e[i]
        by_n, by_e = of_fix_n[i] - c_n, of_fix_e[i] - c_e
        a, b, c, d = a + n * by_n, b + n * by_e, c + e * by_n, d + e * by_e
        nn, ne, ee = nn + n * (n - 2.0 * c_n), ne + n * e - n * c_e - e * c_n, ee + e * (e - 2.0 * c_e)
    (p_nn, p_ne, p_ee), (was_nn, was_ne, was_ee) = before.noise, innovation.noise
    (r_nn, r_ne, _), (_, r_ee, _), _ = fix_noise
    alone = (s_nn - was_nn + p_nn + r_nn, s_ne - was_ne + p_ne + r_ne, s_ee - was_ee + p_ee + r_ee)
    k_nn, k_ne, k_en, k_ee = gain = gain_of((a, b, c, d), alone)
    return RelativeEstimate(
        before.north_m + k_nn * innovation.north_m + k_ne * innovation.east_m,
        before.east_m + k_en * innovation.north_m + k_ee * innovation.east_m,
        (nn - k_nn * a - k_ne * b, ne - k_nn * c - k_ne * d, ee - k_en * c - k_ee * d),
        _down_cov(before, innovation, gain, by_delay, down) if any(down) else (0.0, 0.0),
    )


def _down_cov(
    before: PointEstimate, innovation: Innovation2, gain: Gain, by_delay: BiasShare | None, down: Row
) -> tuple[float, float]:
    """Covariance of a relative estimate with the height, due to the biases: (C - d + K D) times the height's row."""
    (north, east), (a, b, c, d) = before.along(down), gain
    of_n, of_e = (inner(row, down) for row in innovation.shared)
    i, by_n, by_e = by_delay or (0, 0.0, 0.0)
    return north - by_n * down[i] + a * of_n + b * of_e, east - by_e * down[i] + c * of_n + d * of_e
