"""Which kind of wander fixes show: the vehicle's position moves smoothly, or as a first-order process.

With the same sigma and time constant, 1 m and 60 s, the first-order error moves by 0.18 m within a second and the
smooth one by 0.03 m. A filter that supposes the smooth one averages the biases of a turning vehicle over several
seconds: on circles with a first-order error its normalised squares, 2 when honest, were 3.2. No report states the kind,
so means of one second each decide, by a sequential likelihood ratio (Wald 1945); until then the filter takes the mean
of both. All targets show the one position of the vehicle: they share the evidence.

The test takes second differences, in which a constant rate cancels. What the biases do on a turn does not: in circles
of 9 s a mount off by 1 degree at 14 m gives 0.11 m, the first-order error 0.18 m. But a bias is the same in all of
them, so each hypothesis estimates the biases by recursive least squares. On 10 flights of each kind in such circles the
ratio is then decided for the right kind after 3 to 25 s; with the biases as noise it was wrong in half of them.
"""

from __future__ import annotations

from math import exp, log
from operator import mul
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.small_matrices import Row, Symmetric2, gram
from fwav_companion.geometry.stamps import HostNs, ns_from_s, s_from_ns
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate

STEP_S = 1.0
"""Least interval of two means: within it the error of 1 m over 60 s moves by 0.03 m."""
MOST_APART_S = 3.0
"""Interval between two means up to which the error's movement is the greater part of their difference."""
PRIOR_SCORE = 0.5
"""Log-odds of a smooth error before any fix, five to three: receivers and autopilots smooth."""
MOST_SCORE = 10.0
"""Bound of the sum, so that a receiver that behaves differently from now on is believed within seconds."""
SHARE = 0.5
"""Share of each log-likelihood ratio in the sum: successive second differences have two of their three means in common.
"""
BIAS_TIME_S = 100.0
"""Time constant with which estimated biases return to their priors: they are hardly as constant as a filter has them.
"""

MOST_NIS = 20.0
"""Normalised square of a second difference under a first-order error, 2 degrees of freedom, beyond which it counts for
nothing: a false fix, an exchanged target or a jump of the position made it. Noise exceeds it once in 20 000."""
BIAS_SHARE = 0.1
"""Relative error of what biases do to a second difference, one sigma: on a figure eight that is metres, and not linear.
"""

Mean: TypeAlias = tuple[PointEstimate, float]
"""Mean of the fixes of a second, and the interval since the one before, seconds."""


class Hypothesis(msgspec.Struct, frozen=True, gc=False):
    """The biases over their sigmas by the second differences so far, under one kind of wander."""

    mean: Row
    cov: tuple[Row, ...]

    def update(
        self, off: tuple[float, float], rows: tuple[Row, Row], noise: Symmetric2, since_s: float
    ) -> tuple[Hypothesis, float, float]:
        """The biases after an interval and one more second difference, the logarithm of its likelihood up to a
        constant, and its normalised square. ``rows``: of J sigma.

        In the interval the biases return toward their priors, as a first-order process does.
        """
        (of_n, of_e), (nn, ne, ee), kept = rows, noise, exp(-since_s / BIAS_TIME_S)
        kept2, fresh = kept * kept, 1.0 - kept * kept
        by_n = [kept2 * sum(map(mul, row, of_n)) + fresh * own for row, own in zip(self.cov, of_n, strict=True)]
        by_e = [kept2 * sum(map(mul, row, of_e)) + fresh * own for row, own in zip(self.cov, of_e, strict=True)]
        nn, ne, ee = nn + sum(map(mul, of_n, by_n)), ne + sum(map(mul, of_n, by_e)), ee + sum(map(mul, of_e, by_e))
        n, e = off[0] - kept * sum(map(mul, of_n, self.mean)), off[1] - kept * sum(map(mul, of_e, self.mean))
        area2 = nn * ee - ne * ne
        gains = [((a * ee - b * ne) / area2, (b * nn - a * ne) / area2) for a, b in zip(by_n, by_e, strict=True)]
        cov = []
        for i, (row, (a, b)) in enumerate(zip(self.cov, gains, strict=True)):
            after = [kept2 * p - a * x - b * y for p, x, y in zip(row, by_n, by_e, strict=True)]
            after[i] += fresh
            cov.append(tuple(after))
        mean = tuple([kept * x + a * n + b * e for x, (a, b) in zip(self.mean, gains, strict=True)])
        nis = (ee * n * n - 2.0 * ne * n * e + nn * e * e) / area2
        return Hypothesis(mean, tuple(cov)), -0.5 * (log(area2) + nis), nis


class WanderEvidence(msgspec.Struct, frozen=True, gc=False):
    """Log-odds of a smooth error over a first-order one. Immutable."""

    score: float = PRIOR_SCORE
    until_ns: HostNs = HostNs(0)
    """Instant of the last second difference; 0 before the first."""
    smooth: Hypothesis | None = None
    """None before the first second difference."""
    quick: Hypothesis | None = None

    @property
    def smooth_share(self) -> float:
        """Probability that the error is a smooth one."""
        return 1.0 / (1.0 + exp(-self.score))

    def with_means(
        self, means: tuple[Mean, ...], quick_density: float, smooth_density: float, host_ns: HostNs
    ) -> WanderEvidence:
        """The evidence with the three last means of a target, where it has none of the same second.

        ``quick_density``: of the first-order error's rate, m^2/s; ``smooth_density``: of the smooth error's
        acceleration, m^2/s^3.
        """
        if len(means) < 3 or host_ns < self.until_ns + ns_from_s(STEP_S):
            return self
        (_, _), (_, last_s), (_, interval_s) = means
        ratio = interval_s / last_s
        off, rows, noise = _second_difference(means[2][0], means[1][0], means[0][0], ratio)
        smooth, quick = self.smooth, self.quick
        if smooth is None or quick is None:
            smooth = quick = _prior(len(rows[0]))
        by_smooth = _with_variance(noise, smooth_density * interval_s**3)
        by_quick = _with_variance(noise, 0.5 * quick_density * (interval_s + ratio * ratio * last_s))
        since_s = s_from_ns(host_ns - self.until_ns)  # before the first, from which the priors do not change
        smooth, for_smooth, _ = smooth.update(off, rows, by_smooth, since_s)
        quick, for_quick, nis = quick.update(off, rows, by_quick, since_s)
        if nis > MOST_NIS:
            return msgspec.structs.replace(self, until_ns=host_ns)
        score = self.score + SHARE * (for_smooth - for_quick)
        return WanderEvidence(max(-MOST_SCORE, min(MOST_SCORE, score)), host_ns, smooth, quick)


NO_EVIDENCE = WanderEvidence()
"""Before any second difference."""


def with_mean(means: tuple[Mean, ...], mean: PointEstimate, interval_s: float) -> tuple[Mean, ...]:
    """The last three means of a target; a gap begins them again."""
    return (*means[-2:], (mean, interval_s)) if interval_s <= MOST_APART_S else ((mean, interval_s),)


def _second_difference(
    newest: PointEstimate, middle: PointEstimate, oldest: PointEstimate, ratio: float
) -> tuple[tuple[float, float], tuple[Row, Row], Symmetric2]:
    """Newest less the extrapolation of the others; its rows of J sigma, and its noise. ``ratio``: of the intervals."""
    twice = 1.0 + ratio
    nn, ne, ee = (
        a + twice * twice * b + ratio * ratio * c
        for a, b, c in zip(newest.noise, middle.noise, oldest.noise, strict=True)
    )
    of_n, of_e = (
        tuple([a - twice * b + ratio * c for a, b, c in zip(*each, strict=True)])
        for each in zip(newest.shared, middle.shared, oldest.shared, strict=True)
    )
    b_nn, b_ne, b_ee = gram(of_n, of_e)
    share2 = BIAS_SHARE**2
    noise = (nn + share2 * b_nn, ne + share2 * b_ne, ee + share2 * b_ee)
    north_m = newest.north_m - twice * middle.north_m + ratio * oldest.north_m
    east_m = newest.east_m - twice * middle.east_m + ratio * oldest.east_m
    return (north_m, east_m), (of_n, of_e), noise


def _prior(count: int) -> Hypothesis:
    return Hypothesis(
        (0.0,) * count, tuple(tuple([1.0 if i == j else 0.0 for j in range(count)]) for i in range(count))
    )


def _with_variance(noise: Symmetric2, more: float) -> Symmetric2:
    return (noise[0] + more, noise[1], noise[2] + more)
