"""The paper's first-order low-pass, in the NED frame, so that the vehicle's own motion is not lagged.

Exactly as written with ``alpha_rate_hz`` = 0, u_k = alpha x_(k-1) + (1 - alpha) u_(k-1), and in its time-aware form
otherwise, u_k = u_(k-1) + a (x_k - u_(k-1)) with a = 1 - (1 - alpha)^(dt alpha_rate_hz). Both start at their first
sample. The covariance is the exact one of that recursion, biases included: averaging does not remove them.
"""

from __future__ import annotations

from math import pow  # noqa: A004 - of floats, always a float

import msgspec

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.nouns import ErrorPriors, GroundFix
from fwav_companion.tracking.estimate import Estimate, Surprise, blended, blended_noise, first_estimate, surprise
from fwav_companion.tracking.shared import SharedErrors, Weighed


class LowPassBelief(msgspec.Struct, frozen=True):
    """u_k with, in the paper's form, the sample x_k that enters only at the next one."""

    filter: LowPass
    estimate: Estimate
    host_ns: HostNs
    """The instant that the wandering biases stand at."""
    fixed_ns: HostNs
    waiting: Weighed | None = None

    @property
    def position_ned(self) -> Vector3:
        """Metres."""
        return self.estimate.position

    @property
    def cov(self) -> Matrix3:
        """Every source of error, m^2, NED."""
        return self.estimate.cov

    @property
    def relative_cov(self) -> Matrix3:
        """Without the vehicle's own position, m^2, NED."""
        return self.estimate.relative_cov

    @property
    def velocity_ned(self) -> Vector3 | None:
        """The low-pass knows none."""
        return None

    @property
    def velocity_cov(self) -> Matrix3 | None:
        """The low-pass knows none."""
        return None

    def predicted(self, host_ns: HostNs) -> LowPassBelief:
        """The value stays; only the vehicle's position error goes on wandering."""
        was, errors, waiting = self.estimate, self.filter.errors, self.waiting
        shared = errors.faded(was.shared, self.host_ns, host_ns)
        if shared is was.shared:
            return self
        estimate = Estimate(was.position, was.noise, shared, was.wandering, was.wander, was.scatter)
        if waiting is not None:
            waiting = Weighed(waiting.position, waiting.noise, errors.faded(waiting.shared, self.host_ns, host_ns))
        return LowPassBelief(self.filter, estimate, host_ns, self.fixed_ns, waiting)

    def surprise(self, fix: GroundFix) -> Surprise:
        """How little a fix at this instant was expected, horizontal."""
        return surprise(self.estimate, self.filter.errors.weighed(fix, None), self.filter.errors.timed)

    def updated(self, fix: GroundFix) -> LowPassBelief:
        """One step of the recursion."""
        host_ns = fix.sighting.frame_host_ns
        since_s = s_from_ns(host_ns - self.fixed_ns)
        sample = self.filter.errors.weighed(fix, since_s)
        if self.filter.alpha_rate_hz == 0.0:
            entering, waiting = self.waiting, sample
        else:
            entering, waiting = sample, None
        estimate = self.estimate
        if entering is not None:
            estimate = self._step(entering, self.filter.share(since_s))
        return LowPassBelief(self.filter, estimate, self.host_ns, host_ns, waiting)

    def _step(self, sample: Weighed, share: float) -> Estimate:
        gain: Matrix3 = ((share, 0.0, 0.0), (0.0, share, 0.0), (0.0, 0.0, share))
        noise = blended_noise(self.estimate.noise, sample.noise, gain)
        return blended(self.estimate, sample, gain, noise, self.filter.errors.timed)


class LowPass:
    """Starts low-passes, and knows their share of a new sample."""

    __slots__ = ("alpha", "alpha_rate_hz", "errors")

    def __init__(self, alpha: float, alpha_rate_hz: float, priors: ErrorPriors) -> None:
        self.alpha = alpha
        self.alpha_rate_hz = alpha_rate_hz
        self.errors = SharedErrors(priors)

    def share(self, since_s: float) -> float:
        """The share of a sample that comes so long after the one before."""
        if self.alpha_rate_hz == 0.0:
            return self.alpha
        return 1.0 - pow(1.0 - self.alpha, max(0.0, since_s) * self.alpha_rate_hz)

    def started(self, fix: GroundFix) -> LowPassBelief:
        """u_0 = x_0."""
        sample = self.errors.weighed(fix, None)
        host_ns = fix.sighting.frame_host_ns
        waiting = sample if self.alpha_rate_hz == 0.0 else None
        return LowPassBelief(self, first_estimate(sample, self.errors.wandering), host_ns, host_ns, waiting)
