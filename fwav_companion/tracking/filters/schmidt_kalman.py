"""An estimate of a standing point with what its error shares with the biases, and how fixes are blended into it.

With the error e of the estimate and the error m of a fix, a gain K makes the new error e + K (m - e). Noise and biases
are told apart: the covariance of the noise, how the error goes with each bias as it is now, and what the wandering ones
were before and nobody can tell any more. What is here is exact for any gain; choosing one is the filters' business.

Ten targets and ten fixes are a hundred pairs a frame, and ``math.dist`` of two rows takes a quarter of any loop.
"""

from __future__ import annotations

from math import dist, hypot, log
from operator import sub

import msgspec

from fwav_companion.geometry.small_matrices import Symmetric2, inner, symmetric_inverse
from fwav_companion.geometry.vectors import Matrix3, Vector3, add, multiply, subtract, transform, transpose
from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import Measurement, Row, Rows, faded
from fwav_companion.types.tracks import OUTSIDE_GATE, GateResult


class PointEstimate(msgspec.Struct, frozen=True, gc=False):
    """A point and its error by kinds."""

    position: Vector3
    noise: Matrix3
    """Covariance of what fresh noise left, m^2."""
    shared: Rows
    """cov(e, b / sigma) with the biases as they are now, metres."""
    wandering: int
    """Where the wandering biases begin in it."""
    forgotten: Symmetric2
    """Covariance of what the wandering biases did before, beyond what they tell now, horizontal."""
    scatter: AdaptiveNoise
    """How single fixes scatter about it."""

    @property
    def relative_cov(self) -> Matrix3:
        """Without the biases of the vehicle's own position."""
        n, e, d = self.shared
        i = self.wandering
        return _with_biases(self.noise, n[:i], e[:i], d[:i])

    @property
    def cov(self) -> Matrix3:
        """Of every source of error, m^2."""
        (nn, ne, nd), (_, ee, ed), down = _with_biases(self.noise, *self.shared)
        f_nn, f_ne, f_ee = self.forgotten
        return ((nn + f_nn, ne + f_ne, nd), (ne + f_ne, ee + f_ee, ed), down)

    def faded(self, kept: float) -> PointEstimate:
        """The same when so much of the wandering biases is left: what they did becomes another matter."""
        i, lost = self.wandering, 1.0 - kept * kept
        north, east, _ = self.shared
        nn, ne, ee = self.forgotten
        for n, e in zip(north[i:], east[i:], strict=True):
            nn, ne, ee = nn + lost * n * n, ne + lost * n * e, ee + lost * e * e
        return PointEstimate(self.position, self.noise, faded(self.shared, i, kept), i, (nn, ne, ee), self.scatter)


def _with_biases(noise: Matrix3, n: Row, e: Row, d: Row) -> Matrix3:
    (nn, ne, nd), (_, ee, ed), (_, _, dd) = noise
    nn, ne, ee = nn + hypot(*n) ** 2, ne + inner(n, e), ee + hypot(*e) ** 2
    if any(d):  # on level ground no bias moves a point up or down
        nd, ed, dd = nd + inner(n, d), ed + inner(e, d), dd + hypot(*d) ** 2
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


def first_estimate(fix: Measurement, wandering: int) -> PointEstimate:
    """After a first fix: the fix itself."""
    return PointEstimate(fix.position, fix.noise, fix.shared, wandering, (0.0, 0.0, 0.0), AdaptiveNoise())


def kalman_gain(estimate: PointEstimate, fix: Measurement) -> Matrix3:
    """The gain of least noise. It leaves biases alone.

    A gain that also played the biases' sensitivities against one another would be better on paper, and is far worse on
    a real flight: those sensitivities are computed from the same noisy attitudes and heights that move the fix.
    """
    (p00, p01, p02), (_, p11, p12), (_, _, p22) = estimate.noise
    (f00, f01, f02), (_, f11, f12), (_, _, f22) = fix.noise
    s00, s01, s02, s11, s12, s22 = p00 + f00, p01 + f01, p02 + f02, p11 + f11, p12 + f12, p22 + f22
    if p02 == p12 == s02 == s12 == 0.0:  # on level ground height is a matter of its own
        s = 1.0 / (s00 * s11 - s01 * s01)
        a, b, d = s11 * s, -s01 * s, s00 * s
        return (
            (p00 * a + p01 * b, p00 * b + p01 * d, 0.0),
            (p01 * a + p11 * b, p01 * b + p11 * d, 0.0),
            (0.0, 0.0, p22 / s22),
        )
    return multiply(estimate.noise, symmetric_inverse(((s00, s01, s02), (s01, s11, s12), (s02, s12, s22))))


def update(
    estimate: PointEstimate, fix: Measurement, gain: Matrix3, noise: Matrix3, timed: int | None
) -> PointEstimate:
    """The estimate with error e + K (m - e), whose noise is then ``noise``."""
    own, new = estimate.shared, fix.shared
    difference = subtract(fix.position, estimate.position)
    return PointEstimate(
        add(estimate.position, transform(gain, difference)),
        noise,
        blended_shared(own, new, own, gain) if any(own[2]) or any(new[2]) else _blended_level(own, new, gain),
        estimate.wandering,
        _still_forgotten(estimate.forgotten, gain),
        scattered(estimate, difference, fix, timed),
    )


def scattered(estimate: PointEstimate, difference: Vector3, fix: Measurement, timed: int | None) -> AdaptiveNoise:
    """The scatter after a fix that lay so far off."""
    n, e, _ = difference
    own, new = estimate.noise, fix.noise
    thrown2 = 0.0 if timed is None else fix.shared[0][timed] ** 2 + fix.shared[1][timed] ** 2
    return estimate.scatter.with_fix(n * n + e * e, own[0][0] + own[1][1] + new[0][0] + new[1][1], thrown2)


def gate_result(estimate: PointEstimate, fix: Measurement, timed: int | None) -> GateResult:
    """How little a fix was expected. Shared errors cancel as they do in the difference."""
    (fix_n, fix_e, _), (own_n, own_e, _) = fix.shared, estimate.shared
    (p_nn, p_ne, _), (_, p_ee, _), _ = estimate.noise
    (f_nn, f_ne, _), (_, f_ee, _), _ = fix.noise
    gone_nn, gone_ne, gone_ee = estimate.forgotten
    seen = estimate.scatter.variance
    nn = p_nn + f_nn + gone_nn + seen + dist(fix_n, own_n) ** 2
    ee = p_ee + f_ee + gone_ee + seen + dist(fix_e, own_e) ** 2
    n, e = fix.position[0] - estimate.position[0], fix.position[1] - estimate.position[1]
    if n * n > fix.gate * nn or e * e > fix.gate * ee:  # it is at least as far as it is along either axis
        return OUTSIDE_GATE
    ne = p_ne + f_ne + gone_ne + inner(map(sub, fix_n, own_n), map(sub, fix_e, own_e))
    if timed is not None:
        certain = 1.0 - estimate.scatter.doubt
        north, east = fix_n[timed] - own_n[timed], fix_e[timed] - own_e[timed]
        nn, ne, ee = nn - certain * north * north, ne - certain * north * east, ee - certain * east * east
    area2 = nn * ee - ne * ne
    return GateResult((ee * n * n - 2.0 * ne * n * e + nn * e * e) / area2, log(area2 / (f_nn * f_ee - f_ne * f_ne)))


def blended_shared(own: Rows, fix: Rows, estimate: Rows, gain: Matrix3) -> Rows:
    """C + K (J - C_estimate), C being what is blended: the estimate's own rows, or its velocity's."""
    (k00, k01, k02), (k10, k11, k12), (k20, k21, k22) = gain
    north, east, down = [], [], []
    for n, e, d, was_n, was_e, was_d, fix_n, fix_e, fix_d in zip(*own, *estimate, *fix, strict=True):
        x, y, z = fix_n - was_n, fix_e - was_e, fix_d - was_d
        north.append(n + k00 * x + k01 * y + k02 * z)
        east.append(e + k10 * x + k11 * y + k12 * z)
        down.append(d + k20 * x + k21 * y + k22 * z)
    return (tuple(north), tuple(east), tuple(down))


def _blended_level(own: Rows, fix: Rows, gain: Matrix3) -> Rows:
    """The same on level ground, where no bias moves a point up or down: twice as fast."""
    (a, b, _), (c, d, _), _ = gain
    north, east = [], []
    for n, e, fix_n, fix_e in zip(*own[:2], *fix[:2], strict=True):
        x, y = fix_n - n, fix_e - e
        north.append(n + a * x + b * y)
        east.append(e + c * x + d * y)
    return (tuple(north), tuple(east), own[2])


def posterior_noise(own: Matrix3, gain: Matrix3) -> Matrix3:
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


def joseph_update(own: Matrix3, fix: Matrix3, gain: Matrix3) -> Matrix3:
    """(I - K) P (I - K)' + K R K', for any gain."""
    (a, b, c), (d, e, f), (g, h, i) = gain
    rest = ((1.0 - a, -b, -c), (-d, 1.0 - e, -f), (-g, -h, 1.0 - i))
    kept, come = multiply(multiply(rest, own), transpose(rest)), multiply(multiply(gain, fix), transpose(gain))
    (nn, ne, nd), (_, ee, ed), (_, _, dd) = kept
    (c_nn, c_ne, c_nd), (_, c_ee, c_ed), (_, _, c_dd) = come
    nn, ne, nd, ee, ed, dd = nn + c_nn, ne + c_ne, nd + c_nd, ee + c_ee, ed + c_ed, dd + c_dd
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, dd))


def _still_forgotten(forgotten: Symmetric2, gain: Matrix3) -> Symmetric2:
    """(I - K) F (I - K)': a fix knows the wandering biases as they are now, and nothing of what they were."""
    nn, ne, ee = forgotten
    (a, b, _), (c, d, _), _ = gain
    a, d = 1.0 - a, 1.0 - d
    return (
        a * a * nn - 2.0 * a * b * ne + b * b * ee,
        (a * d + b * c) * ne - a * c * nn - b * d * ee,
        c * c * nn - 2.0 * c * d * ne + d * d * ee,
    )
