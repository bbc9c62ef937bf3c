"""An estimate of a standing point with what its error shares with the biases, and how fixes are blended into it.

With the error e of the estimate and the error m of a fix, a gain K makes the new error e + K (m - e). Noise and biases
are told apart: the covariance of the noise, the sensitivities to the standing biases, and the covariance that the
wandering ones make. What is here is exact for any gain; choosing one is the filters' business.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log, sqrt
from operator import mul

import msgspec

from fwav_companion.geometry.vectors import Matrix3, Vector3, add, multiply, subtract, transform, transpose
from fwav_companion.tracking.linear import Symmetric2, symmetric_inverse
from fwav_companion.tracking.shared import Rows, Weighed

SCATTER_SHARE = 0.02
"""Of a new fix in what was seen: fifty fixes, eight beats of 5 Hz at 30 frames/s."""
FIXES_TO_LEARN = 20
"""Three beats of 5 Hz at 30 frames/s: by then what a time offset does to this target was seen."""
MOST_SCATTER = 4.0
"""Times what one sigma of the time offset makes: two sigma."""
LEAST_DOUBT = 0.1
"""A glide does not show what the next beat will."""


class Scatter(msgspec.Struct, frozen=True, gc=False):
    """How far fixes lie from the estimate beyond their noise: what a standing time offset does on a flapping wing.

    It throws single fixes much farther than their mean, and not in proportion to the rate of the moment; so what its
    prior allows is believed of a new target only, and of an old one what was seen.
    """

    variance: float = 0.0
    """Seen, an axis, m^2; at most what is allowed: clutter must not widen a gate that lets in more clutter."""
    allowed: float = 0.0
    """By the prior of the time offset, an axis, as a running mean over the fixes, m^2."""
    count: int = 1
    """Fixes blended."""

    def with_fix(self, distance2: float, expected2: float, thrown2: float) -> Scatter:
        """With one more fix, so far from the estimate, where noise alone made so much, and one sigma of the time
        offset throws it so far: squares of two axes, m^2.
        """
        share = max(SCATTER_SHARE, 1.0 / (self.count + 1))
        allowed = self.allowed + share * (0.5 * thrown2 - self.allowed)
        variance = self.variance + share * (0.5 * (distance2 - expected2) - self.variance)
        return Scatter(min(max(0.0, variance), MOST_SCATTER * allowed), allowed, self.count + 1)

    @property
    def doubt(self) -> float:
        """The share of what the time offset's prior allows that is still to be reckoned with."""
        return max(LEAST_DOUBT, 1.0 - self.count / FIXES_TO_LEARN)


class Surprise(msgspec.Struct, frozen=True, gc=False):
    """How little a fix was expected."""

    distance2: float
    """Squared Mahalanobis distance, 2 degrees of freedom."""
    spread: float
    """Log of how much wider than the fix's own noise it was looked for: areas squared."""


class Estimate(msgspec.Struct, frozen=True, gc=False):
    """A point and its error by kinds."""

    position: Vector3
    noise: Matrix3
    """Covariance of what fresh noise left, m^2."""
    shared: Rows
    """cov(e, b / sigma), metres."""
    wandering: int
    """Where the wandering biases begin in it."""
    wander: Symmetric2
    """Covariance of what the wandering biases left, horizontal."""
    scatter: Scatter
    """How single fixes scatter about it."""

    @property
    def relative_cov(self) -> Matrix3:
        """Without the biases of the vehicle's own position."""
        (nn, ne, nd), (_, ee, ed), (_, _, dd) = self.noise
        n, e, d = (row[: self.wandering] for row in self.shared)
        nn, ne, nd = nn + inner(n, n), ne + inner(n, e), nd + inner(n, d)
        ee, ed, dd = ee + inner(e, e), ed + inner(e, d), dd + inner(d, d)
        return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))

    @property
    def cov(self) -> Matrix3:
        """Of every source of error, m^2."""
        (nn, ne, nd), (_, ee, ed), (_, _, dd) = self.relative_cov
        w_nn, w_ne, w_ee = self.wander
        nn, ne, ee = nn + w_nn, ne + w_ne, ee + w_ee
        return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


def inner(a: Sequence[float], b: Sequence[float]) -> float:
    """The inner product of two rows."""
    return sum(map(mul, a, b), 0.0)


def first_estimate(fix: Weighed, wandering: int) -> Estimate:
    """After a first fix: the fix itself."""
    north, east = fix.shared[0][wandering:], fix.shared[1][wandering:]
    wander = (inner(north, north), inner(north, east), inner(east, east))
    return Estimate(fix.position, fix.noise, fix.shared, wandering, wander, Scatter())


def noise_gain(estimate: Estimate, fix: Weighed) -> Matrix3:
    """The gain of least noise. It leaves biases alone.

    A gain that also played the biases' sensitivities against one another would be better on paper, and is far worse on
    a real flight: those sensitivities are computed from the same noisy attitudes and heights that move the fix.
    """
    (p00, p01, p02), (_, p11, p12), (_, _, p22) = estimate.noise
    (f00, f01, f02), (_, f11, f12), (_, _, f22) = fix.noise
    s01, s02, s12 = p01 + f01, p02 + f02, p12 + f12
    both = ((p00 + f00, s01, s02), (s01, p11 + f11, s12), (s02, s12, p22 + f22))
    return multiply(estimate.noise, symmetric_inverse(both))


def blended(estimate: Estimate, fix: Weighed, gain: Matrix3, noise: Matrix3, timed: int | None) -> Estimate:
    """The estimate with error e + K (m - e), whose noise is then ``noise``."""
    difference = subtract(fix.position, estimate.position)
    return Estimate(
        add(estimate.position, transform(gain, difference)),
        noise,
        blended_shared(estimate.shared, fix.shared, estimate.shared, gain),
        estimate.wandering,
        _blended_wander(estimate, fix, gain),
        scattered(estimate, difference, fix, timed),
    )


def scattered(estimate: Estimate, difference: Vector3, fix: Weighed, timed: int | None) -> Scatter:
    """The scatter after a fix that lay so far off."""
    n, e, _ = difference
    own, new = estimate.noise, fix.noise
    thrown2 = 0.0 if timed is None else fix.shared[0][timed] ** 2 + fix.shared[1][timed] ** 2
    return estimate.scatter.with_fix(n * n + e * e, own[0][0] + own[1][1] + new[0][0] + new[1][1], thrown2)


def surprise(estimate: Estimate, fix: Weighed, timed: int | None) -> Surprise:
    """How little a fix was expected. Shared errors cancel as they do in the difference."""
    (fix_n, fix_e, _), (own_n, own_e, _) = fix.shared, estimate.shared
    i = estimate.wandering
    north = [a - b for a, b in zip(fix_n[:i], own_n[:i], strict=True)]
    east = [a - b for a, b in zip(fix_e[:i], own_e[:i], strict=True)]
    if timed is not None:
        doubt = sqrt(estimate.scatter.doubt)
        north[timed], east[timed] = doubt * north[timed], doubt * east[timed]
    wander_nn, wander_ne, wander_ee = _wander_difference(estimate, fix)
    (p_nn, p_ne, _), (_, p_ee, _), _ = estimate.noise
    (f_nn, f_ne, _), (_, f_ee, _), _ = fix.noise
    seen = estimate.scatter.variance
    nn = p_nn + f_nn + inner(north, north) + wander_nn + seen
    ne = p_ne + f_ne + inner(north, east) + wander_ne
    ee = p_ee + f_ee + inner(east, east) + wander_ee + seen
    n, e = fix.position[0] - estimate.position[0], fix.position[1] - estimate.position[1]
    area2 = nn * ee - ne * ne
    return Surprise((ee * n * n - 2.0 * ne * n * e + nn * e * e) / area2, log(area2 / (f_nn * f_ee - f_ne * f_ne)))


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


def least_noise(own: Matrix3, gain: Matrix3) -> Matrix3:
    """(I - K) P: what is left by the gain of least noise, and by no other."""
    (nn, ne, nd), (_, ee, ed), (_, _, dd) = own
    (a, b, c), (d, e, f), (g, h, i) = gain
    left_ne = ne - a * ne - b * ee - c * ed
    left_nd = nd - a * nd - b * ed - c * dd
    left_ed = ed - d * nd - e * ed - f * dd
    return (
        (nn - a * nn - b * ne - c * nd, left_ne, left_nd),
        (left_ne, ee - d * ne - e * ee - f * ed, left_ed),
        (left_nd, left_ed, dd - g * nd - h * ed - i * dd),
    )


def blended_noise(own: Matrix3, fix: Matrix3, gain: Matrix3) -> Matrix3:
    """(I - K) P (I - K)' + K R K', for any gain."""
    (a, b, c), (d, e, f), (g, h, i) = gain
    rest = ((1.0 - a, -b, -c), (-d, 1.0 - e, -f), (-g, -h, 1.0 - i))
    kept, come = multiply(multiply(rest, own), transpose(rest)), multiply(multiply(gain, fix), transpose(gain))
    (nn, ne, nd), (_, ee, ed), (_, _, dd) = kept
    (c_nn, c_ne, c_nd), (_, c_ee, c_ed), (_, _, c_dd) = come
    nn, ne, nd, ee, ed, dd = nn + c_nn, ne + c_ne, nd + c_nd, ee + c_ee, ed + c_ed, dd + c_dd
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


def _blended_wander(estimate: Estimate, fix: Weighed, gain: Matrix3) -> Symmetric2:
    """W + K S K' + K (M - W)' + its transpose, with M = cov(e, m) and S = cov(m - e) of the wandering part."""
    if estimate.wandering == len(estimate.shared[0]):
        return estimate.wander
    w_nn, w_ne, w_ee = estimate.wander
    c_nn, c_ne, c_en, c_ee = _wander_common(estimate, fix)
    s_nn, s_ne, s_ee = _wander_difference(estimate, fix)
    (a, b, _), (c, d, _), _ = gain
    u_nn, u_ne, u_en, u_ee = w_nn - c_nn, w_ne - c_ne, w_ne - c_en, w_ee - c_ee
    pulled_nn, pulled_ne = a * u_nn + b * u_ne, a * u_en + b * u_ee
    pulled_en, pulled_ee = c * u_nn + d * u_ne, c * u_en + d * u_ee
    return (
        w_nn + a * a * s_nn + 2.0 * a * b * s_ne + b * b * s_ee - 2.0 * pulled_nn,
        w_ne + a * c * s_nn + (a * d + b * c) * s_ne + b * d * s_ee - pulled_ne - pulled_en,
        w_ee + c * c * s_nn + 2.0 * c * d * s_ne + d * d * s_ee - 2.0 * pulled_ee,
    )


def _wander_common(estimate: Estimate, fix: Weighed) -> tuple[float, float, float, float]:
    i = estimate.wandering
    own_n, own_e = estimate.shared[0][i:], estimate.shared[1][i:]
    fix_n, fix_e = fix.shared[0][i:], fix.shared[1][i:]
    return inner(own_n, fix_n), inner(own_n, fix_e), inner(own_e, fix_n), inner(own_e, fix_e)


def _wander_difference(estimate: Estimate, fix: Weighed) -> Symmetric2:
    i = estimate.wandering
    if i == len(estimate.shared[0]):
        return (0.0, 0.0, 0.0)
    w_nn, w_ne, w_ee = estimate.wander
    c_nn, c_ne, c_en, c_ee = _wander_common(estimate, fix)
    north, east = fix.shared[0][i:], fix.shared[1][i:]
    return (
        w_nn + inner(north, north) - 2.0 * c_nn,
        w_ne + inner(north, east) - c_ne - c_en,
        w_ee + inner(east, east) - 2.0 * c_ee,
    )
