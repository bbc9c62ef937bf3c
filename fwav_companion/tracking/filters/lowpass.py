"""The paper's first-order low-pass, in the NED frame, so that the vehicle's own motion is not lagged.

Exactly as written with ``alpha_rate_hz`` = 0, u_k = alpha x_(k-1) + (1 - alpha) u_(k-1), and in its time-aware form
otherwise, u_k = u_(k-1) + a (x_k - u_(k-1)) with a = 1 - (1 - alpha)^(dt alpha_rate_hz). Both start at their first
sample. The covariance is the exact one of that recursion, biases included: averaging does not remove them.
"""

from __future__ import annotations

from math import pow  # noqa: A004 - of floats, always a float

from msgspec.structs import replace

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.tracking.filters.consider_biases import ConsiderBiases, Measurement, faded
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate, first_estimate, joseph_update, update
from fwav_companion.tracking.filters.standing import StandingTargetState
from fwav_companion.types import ErrorPriors, GroundFix


class LowPassTargetState(StandingTargetState, frozen=True, kw_only=True):
    """u_k with, in the paper's form, the sample x_k that enters only at the next one."""

    filter: LowPass
    waiting: Measurement | None = None

    def predict(self, host_ns: HostNs) -> LowPassTargetState:
        """The value stays; only the vehicle's position error goes on wandering."""
        kept, waiting = self.errors.kept(self.host_ns, host_ns), self.waiting
        if kept == 1.0:
            return self
        if waiting is not None:
            shared = faded(waiting.shared, self.errors.wandering, kept)
            waiting = Measurement(waiting.position, waiting.noise, shared, waiting.gate)
        return replace(self, estimate=self.estimate.faded(kept), host_ns=host_ns, waiting=waiting)

    def update(self, fix: GroundFix) -> LowPassTargetState:
        """One step of the recursion."""
        host_ns = fix.sighting.frame_host_ns
        since_s = s_from_ns(host_ns - self.fixed_ns)
        sample = self.errors.weighed_after(fix, since_s)
        if self.filter.alpha_rate_hz == 0.0:
            entering, waiting = self.waiting, sample
        else:
            entering, waiting = sample, None
        estimate = self.estimate
        if entering is not None:
            estimate = self._step(entering, self.filter.share(since_s))
        return replace(self, estimate=estimate, fixed_ns=host_ns, waiting=waiting)

    def _step(self, sample: Measurement, share: float) -> PointEstimate:
        gain: Matrix3 = ((share, 0.0, 0.0), (0.0, share, 0.0), (0.0, 0.0, share))
        noise = joseph_update(self.estimate.noise, sample.noise, gain)
        return update(self.estimate, sample, gain, noise, self.errors.timed)


class LowPass:
    """Starts low-passes, and knows their share of a new sample."""

    __slots__ = ("_errors", "alpha", "alpha_rate_hz")

    def __init__(self, alpha: float, alpha_rate_hz: float, priors: ErrorPriors) -> None:
        self.alpha = alpha
        self.alpha_rate_hz = alpha_rate_hz
        self._errors = ConsiderBiases(priors)

    def share(self, since_s: float) -> float:
        """The share of a sample that comes so long after the one before."""
        if self.alpha_rate_hz == 0.0:
            return self.alpha
        return 1.0 - pow(1.0 - self.alpha, max(0.0, since_s) * self.alpha_rate_hz)

    def initiate(self, fix: GroundFix) -> LowPassTargetState:
        """u_0 = x_0."""
        host_ns, errors = fix.sighting.frame_host_ns, self._errors
        sample = errors.weighed(fix)
        waiting = sample if self.alpha_rate_hz == 0.0 else None
        estimate = first_estimate(sample, errors.wandering)
        return LowPassTargetState(errors, estimate, host_ns, host_ns, filter=self, waiting=waiting)
