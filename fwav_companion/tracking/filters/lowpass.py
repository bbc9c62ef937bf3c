"""The paper's first-order low-pass, in the NED frame, so that it does not lag behind the vehicle's own motion.

With ``alpha_rate_hz`` = 0 it is the paper's recursion, u_k = alpha x_(k-1) + (1 - alpha) u_(k-1). Otherwise it is the
form for any interval, u_k = u_(k-1) + a (x_k - u_(k-1)) with a = 1 - (1 - alpha)^(dt alpha_rate_hz). Both start at
their first sample. The covariance is exact for the recursion, biases included: averaging does not remove them.
"""

from __future__ import annotations

from math import pow  # noqa: A004 - of floats, always a float
from typing import Self

from msgspec.structs import replace

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.tracking.filters.consider_biases import Measurement
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate, first_down, first_point_estimate, scattered
from fwav_companion.tracking.filters.standing import StandingModel, StandingTargetState, apart_at
from fwav_companion.types import ErrorPriors, GroundFix


class LowPassTargetState(StandingTargetState, frozen=True, kw_only=True, gc=False):
    """State of the low-pass: u_k and, in the paper's form, the sample x_k, which enters only with the next sample."""

    filter: LowPass
    waiting: Measurement | None = None

    def update(self, fix: GroundFix) -> Self:
        """One step of the recursion."""
        errors, host_ns = self.model.errors, fix.sighting.frame_host_ns
        since_s = s_from_ns(host_ns - self.fixed_ns)
        sample = errors.decorrelated(fix, since_s)
        if self.filter.alpha_rate_hz == 0.0:
            entering, waiting = self.waiting, sample
        else:
            entering, waiting = sample, None
        state = self if entering is None else self._step(entering, self.filter.share(since_s), host_ns)
        scatter = scattered(self.apparent, self.scatter, errors.prepared(fix), errors.timed)
        wander = self.model.wander_at(fix)
        return replace(
            state,
            wander=wander,
            predicted=state.apparent,
            scatter=scatter,
            late=errors.by_delay(sample),
            fixed_ns=host_ns,
            host_ns=host_ns,
            waiting=waiting,
        )

    def _step(self, sample: Measurement, share: float, host_ns: HostNs) -> Self:
        """The state after one step of the recursion. u contains the position errors at the times of its samples."""
        apparent = self.before(host_ns).mixed(sample, sample.noise, share)
        return replace(self, apparent=apparent, down=self.down.update(sample, share))

    @property
    def _place(self) -> PointEstimate:
        """The estimate u with the whole prior of the position error, which less than a second does not average out."""
        variance = self.wander.sigma_m**2
        return self.apparent.with_noise((variance, 0.0, variance))


class LowPass:
    """The low-pass filter: initiates targets, and computes the gain of a new sample."""

    __slots__ = ("_model", "alpha", "alpha_rate_hz")

    def __init__(self, alpha: float, alpha_rate_hz: float, priors: ErrorPriors) -> None:
        self.alpha = alpha
        self.alpha_rate_hz = alpha_rate_hz
        self._model = StandingModel(priors)

    def share(self, since_s: float) -> float:
        """The gain of a sample ``since_s`` seconds after the previous one."""
        if self.alpha_rate_hz == 0.0:
            return self.alpha
        return 1.0 - pow(1.0 - self.alpha, max(0.0, since_s) * self.alpha_rate_hz)

    def initiate(self, fix: GroundFix) -> LowPassTargetState:
        """The state after the first sample: u_0 = x_0."""
        model, host_ns = self._model, fix.sighting.frame_host_ns
        sample = model.errors.prepared(fix)
        apparent = first_point_estimate(sample)
        return LowPassTargetState(
            model=model,
            wander=model.wander_at(fix),
            apparent=apparent,
            predicted=apparent,
            down=first_down(sample),
            apart_ns=apart_at(fix),
            placed_ns=host_ns,
            fixed_ns=host_ns,
            host_ns=host_ns,
            filter=self,
            waiting=sample if self.alpha_rate_hz == 0.0 else None,
        )
