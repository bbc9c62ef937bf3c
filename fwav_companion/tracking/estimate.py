"""An estimate of a standing point with what its error shares with the biases, and how fixes are blended into it.

With the error e of the estimate and the error m of a fix, a gain K makes the new error e + K (m - e). What is here is
the exact covariance of that, for any gain: the Kalman filter chooses K for the least, the low-pass takes it as it is.
"""

from __future__ import annotations

from operator import mul

import msgspec

from fwav_companion.geometry.vectors import Matrix3, Vector3, add, multiply, subtract, transform, transpose
from fwav_companion.tracking.linear import Symmetric2, symmetric_inverse
from fwav_companion.tracking.shared import Rows, Weighed


class Estimate(msgspec.Struct, frozen=True, gc=False):
    """A point, its total covariance, and its error's covariance with the biases."""

    position: Vector3
    cov: Matrix3
    """Of the error e, every source, m^2."""
    shared: Rows
    """cov(e, b / sigma), metres."""
    own_position_cov: Symmetric2
    """What of cov comes from the vehicle's position."""

    @classmethod
    def of(cls, fix: Weighed) -> Estimate:
        """The estimate after a first fix: the fix itself."""
        return cls(fix.position, fix.cov, fix.shared, fix.own_position_cov)

    @property
    def relative_cov(self) -> Matrix3:
        """Without the vehicle's own position."""
        (nn, ne, nd), (_, ee, ed), (_, _, dd) = self.cov
        own_nn, own_ne, own_ee = self.own_position_cov
        nn, ne, ee = nn - own_nn, ne - own_ne, ee - own_ee
        return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


class Innovation(msgspec.Struct, frozen=True, gc=False):
    """What a fix says beyond the estimate: m - e, and how its covariance comes about."""

    difference: Vector3
    common: Matrix3
    """cov(e, m)."""
    cov: Matrix3
    """cov(m - e)."""


def common(own: Rows, fix: Rows) -> Matrix3:
    """cov(e, m): what two errors share through the biases."""
    (n, e, d), (fn, fe, fd) = own, fix
    return (
        (sum(map(mul, n, fn)), sum(map(mul, n, fe)), sum(map(mul, n, fd))),
        (sum(map(mul, e, fn)), sum(map(mul, e, fe)), sum(map(mul, e, fd))),
        (sum(map(mul, d, fn)), sum(map(mul, d, fe)), sum(map(mul, d, fd))),
    )


def innovation(estimate: Estimate, fix: Weighed) -> Innovation:
    """Fix minus estimate. Shared errors cancel in its covariance as they do in the difference."""
    both = common(estimate.shared, fix.shared)
    (nn, ne, nd), (en, ee, ed), (dn, de, dd) = both
    (p00, p01, p02), (_, p11, p12), (_, _, p22) = estimate.cov
    (f00, f01, f02), (_, f11, f12), (_, _, f22) = fix.cov
    s01, s02, s12 = p01 + f01 - ne - en, p02 + f02 - nd - dn, p12 + f12 - ed - de
    return Innovation(
        subtract(fix.position, estimate.position),
        both,
        ((p00 + f00 - 2.0 * nn, s01, s02), (s01, p11 + f11 - 2.0 * ee, s12), (s02, s12, p22 + f22 - 2.0 * dd)),
    )


def best_gain(estimate: Estimate, seen: Innovation) -> Matrix3:
    """The gain of least covariance: cov(e, e - m) cov(m - e)^-1."""
    own, common = estimate.cov, seen.common
    useful = (subtract(own[0], common[0]), subtract(own[1], common[1]), subtract(own[2], common[2]))
    return multiply(useful, symmetric_inverse(seen.cov))


def blended(estimate: Estimate, fix: Weighed, seen: Innovation, gain: Matrix3, wandering: tuple[int, int]) -> Estimate:
    """The estimate with error e + K (m - e)."""
    return Estimate(
        add(estimate.position, transform(gain, seen.difference)),
        _blended_cov(estimate.cov, seen.common, seen.cov, gain),
        blended_shared(estimate.shared, fix.shared, estimate.shared, gain),
        _blended_own_position(estimate, fix, gain, wandering),
    )


def blended_shared(own: Rows, fix: Rows, estimate: Rows, gain: Matrix3) -> Rows:
    """C + K (J - C_estimate), C being what is blended: the estimate's own rows, or its velocity's."""
    (k00, k01, k02), (k10, k11, k12), (k20, k21, k22) = gain
    steps = [(fn - n, fe - e, fd - d) for n, e, d, fn, fe, fd in zip(*estimate, *fix, strict=True)]
    n, e, d = own
    return (
        tuple([c + k00 * x + k01 * y + k02 * z for c, (x, y, z) in zip(n, steps, strict=True)]),
        tuple([c + k10 * x + k11 * y + k12 * z for c, (x, y, z) in zip(e, steps, strict=True)]),
        tuple([c + k20 * x + k21 * y + k22 * z for c, (x, y, z) in zip(d, steps, strict=True)]),
    )


def _blended_cov(own: Matrix3, common: Matrix3, seen: Matrix3, gain: Matrix3) -> Matrix3:
    """P + K S K' + K (M - P)' + its transpose, with M = cov(e, m) and S = cov(m - e)."""
    to_own = (subtract(own[0], common[0]), subtract(own[1], common[1]), subtract(own[2], common[2]))
    half = multiply(gain, seen)
    spread = multiply(half, transpose(gain))
    pulled = multiply(gain, transpose(to_own))
    (a, b, c), (_, d, e), (_, _, f) = own
    (s00, s01, s02), (_, s11, s12), (_, _, s22) = spread
    (p00, p01, p02), (p10, p11, p12), (p20, p21, p22) = pulled
    b, c, e = b + s01 - p01 - p10, c + s02 - p02 - p20, e + s12 - p12 - p21
    return ((a + s00 - 2.0 * p00, b, c), (b, d + s11 - 2.0 * p11, e), (c, e, f + s22 - 2.0 * p22))


def _blended_own_position(estimate: Estimate, fix: Weighed, gain: Matrix3, wandering: tuple[int, int]) -> Symmetric2:
    """The same for the part of the covariance that the vehicle's position makes, horizontal."""
    fix_nn, fix_ne, fix_ee = fix.own_position_cov
    own_nn, own_ne, own_ee = estimate.own_position_cov
    if fix_nn == 0.0 and fix_ee == 0.0 and own_nn == 0.0 and own_ee == 0.0:
        return (0.0, 0.0, 0.0)
    c_nn, c_ne, c_en, c_ee = _common_position(estimate.shared, fix.shared, wandering)
    s_nn = own_nn + fix_nn - 2.0 * c_nn
    s_ne = own_ne + fix_ne - c_ne - c_en
    s_ee = own_ee + fix_ee - 2.0 * c_ee
    (a, b, _), (c, d, _), _ = gain
    u_nn, u_ne, u_en, u_ee = own_nn - c_nn, own_ne - c_ne, own_ne - c_en, own_ee - c_ee
    pulled_nn, pulled_ne = a * u_nn + b * u_ne, a * u_en + b * u_ee
    pulled_en, pulled_ee = c * u_nn + d * u_ne, c * u_en + d * u_ee
    return (
        own_nn + a * a * s_nn + 2.0 * a * b * s_ne + b * b * s_ee - 2.0 * pulled_nn,
        own_ne + a * c * s_nn + (a * d + b * c) * s_ne + b * d * s_ee - pulled_ne - pulled_en,
        own_ee + c * c * s_nn + 2.0 * c * d * s_ne + d * d * s_ee - 2.0 * pulled_ee,
    )


def _common_position(own: Rows, fix: Rows, wandering: tuple[int, int]) -> tuple[float, float, float, float]:
    nn = ne = en = ee = 0.0
    for i in range(*wandering):
        nn, ne = nn + own[0][i] * fix[0][i], ne + own[0][i] * fix[1][i]
        en, ee = en + own[1][i] * fix[0][i], ee + own[1][i] * fix[1][i]
    return nn, ne, en, ee
