"""Sequential test of the vehicle's position error: it moves smoothly, or as a first-order process.

With the same sigma and time constant, 1 m and 60 s, the first-order error moves by 0.18 m within a second and the
smooth one by 0.03 m. A filter that assumes the smooth error averages the biases of a turning vehicle over several
seconds: on circles with a first-order error its normalised squared errors were 3.2, where 2 is right. No report states
the kind. So the means of one second of fixes each decide, by a sequential likelihood ratio (Wald 1945); until then the
filter uses the mean of both variances. All targets show the same position of the vehicle, so they share the evidence.

The test uses second differences, in which a constant rate cancels. The effect of the biases on a turn does not: on
circles of 9 s a mount off by 1 degree at 14 m gives 0.11 m, the first-order error 0.18 m. But a bias is the same in all
second differences, so each hypothesis estimates the biases by recursive least squares. On 10 flights of each kind with
such circles the test then decides for the right kind after 3 to 25 s; with the biases as noise it was wrong in half.
"""

from __future__ import annotations

from math import exp
from typing import TypeAlias

import msgspec
from msgspec.structs import replace

from fwav_companion.geometry.small_matrices import gram
from fwav_companion.geometry.stamps import HostNs, ns_from_s, s_from_ns
from fwav_companion.tracking.filters.base import SharedInnovation
from fwav_companion.tracking.filters.bias_estimate import BiasEstimate
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate

STEP_S = 1.0
"""Least interval of two means, seconds: within it a smooth error of 1 m and 60 s moves by 0.03 m."""
MOST_APART_S = 3.0
"""Largest interval between two means, seconds: up to it the error's movement is the greater part of their difference.
"""
PRIOR_SCORE = 0.5
"""Prior log-odds of a smooth error, five to three: receivers and autopilots smooth."""
MOST_SCORE = 10.0
"""Limit of the log-odds, so that a change in the behaviour of a receiver is accepted within seconds."""
SHARE = 0.5
"""Weight of each log-likelihood ratio in the sum: successive second differences share two of their three means."""
BIAS_TIME_S = 100.0
"""Time constant with which estimated biases return to their priors, seconds: real biases are not quite constant."""

MOST_NIS = 20.0
"""Gate on the NIS of a second difference under a first-order error, 2 degrees of freedom. Beyond it the difference is
ignored: a false fix, an exchanged target or a jump of the position caused it. Noise exceeds it once in 20 000 times."""
BIAS_SHARE = 0.1
"""Relative error of the effect of biases on a second difference, one sigma: on a figure-eight that effect is metres,
and not linear."""

Mean: TypeAlias = tuple[PointEstimate, float]
"""Mean of the fixes of a second, and the interval since the previous mean, seconds."""


class WanderEvidence(msgspec.Struct, frozen=True, gc=False):
    """Log-odds of a smooth error over a first-order one. Immutable."""

    score: float = PRIOR_SCORE
    until_ns: HostNs = HostNs(0)
    """Instant of the last second difference; 0 before the first."""
    smooth: BiasEstimate | None = None
    """Biases estimated from the second differences so far, under a smooth error; None before the first."""
    quick: BiasEstimate | None = None
    """The same biases, estimated under a first-order error."""

    @property
    def smooth_share(self) -> float:
        """Probability that the error is smooth."""
        return 1.0 / (1.0 + exp(-self.score))

    def with_means(
        self, means: tuple[Mean, ...], quick_density: float, smooth_density: float, host_ns: HostNs
    ) -> WanderEvidence:
        """The evidence after the three last means of a target; unchanged if it includes a target of the same second.

        ``quick_density``: spectral density of the first-order error's rate, m^2/s; ``smooth_density``: of the smooth
        error's acceleration, m^2/s^3.
        """
        if len(means) < 3 or host_ns < self.until_ns + ns_from_s(STEP_S):
            return self
        (oldest, _), (middle, last_s), (newest, interval_s) = means
        ratio = interval_s / last_s
        innovation = _second_difference(newest, middle, oldest, ratio)
        unknown = BiasEstimate.prior(len(innovation.shared[0]))
        # Before the first second difference there is no interval; but priors do not decay in any interval.
        left = (exp(-s_from_ns(host_ns - self.until_ns) / BIAS_TIME_S),) * len(unknown.mean)
        smooth, quick = (self.smooth or unknown).decayed(left), (self.quick or unknown).decayed(left)
        smooth_variance = smooth_density * interval_s**3
        quick_variance = 0.5 * quick_density * (interval_s + ratio * ratio * last_s)
        by_smooth = smooth.residual(_with_variance(innovation, smooth_variance))
        by_quick = quick.residual(_with_variance(innovation, quick_variance))
        if by_quick.nis > MOST_NIS:
            return replace(self, until_ns=host_ns)
        score = self.score + SHARE * (by_smooth.log_likelihood - by_quick.log_likelihood)
        score = max(-MOST_SCORE, min(MOST_SCORE, score))
        return WanderEvidence(score, host_ns, smooth.update(by_smooth), quick.update(by_quick))


NO_EVIDENCE = WanderEvidence()
"""The evidence before any second difference."""


def with_mean(means: tuple[Mean, ...], mean: PointEstimate, interval_s: float) -> tuple[Mean, ...]:
    """The last three means of a target, with a new one; after a gap, the new one alone."""
    return (*means[-2:], (mean, interval_s)) if interval_s <= MOST_APART_S else ((mean, interval_s),)


def _second_difference(
    newest: PointEstimate, middle: PointEstimate, oldest: PointEstimate, ratio: float
) -> SharedInnovation:
    """The newest mean minus the extrapolation of the others. ``ratio``: newer interval over older interval."""
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
    return SharedInnovation(
        newest.north_m - twice * middle.north_m + ratio * oldest.north_m,
        newest.east_m - twice * middle.east_m + ratio * oldest.east_m,
        (of_n, of_e),
        (nn + share2 * b_nn, ne + share2 * b_ne, ee + share2 * b_ee),
    )


def _with_variance(innovation: SharedInnovation, more: float) -> SharedInnovation:
    nn, ne, ee = innovation.noise
    return replace(innovation, noise=(nn + more, ne, ee + more))
