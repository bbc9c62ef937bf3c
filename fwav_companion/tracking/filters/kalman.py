"""The Kalman filter of a target that stands still."""

from __future__ import annotations

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.tracking.filters.consider_biases import ConsiderBiases
from fwav_companion.tracking.filters.schmidt_kalman import first_estimate, kalman_gain, posterior_noise, update
from fwav_companion.tracking.filters.standing import StandingTargetState
from fwav_companion.types import ErrorPriors, GroundFix


class StaticTargetState(StandingTargetState, frozen=True):
    """Each fix weighed with its own covariance and with what it shares with those before."""

    def predict(self, host_ns: HostNs) -> StaticTargetState:
        """The target stays; only the vehicle's position error goes on wandering."""
        kept = self.errors.kept(self.host_ns, host_ns)
        return (
            self if kept == 1.0 else StaticTargetState(self.errors, self.estimate.faded(kept), host_ns, self.fixed_ns)
        )

    def update(self, fix: GroundFix) -> StaticTargetState:
        """With the gain of least noise: the weighted mean of all fixes."""
        errors, estimate, host_ns = self.errors, self.estimate, fix.sighting.frame_host_ns
        weighed = errors.weighed_after(fix, s_from_ns(host_ns - self.fixed_ns), estimate.position)
        gain = kalman_gain(estimate, weighed)
        noise = posterior_noise(estimate.noise, gain)
        return StaticTargetState(errors, update(estimate, weighed, gain, noise, errors.timed), self.host_ns, host_ns)


class StaticKalman:
    """Starts beliefs about standing targets."""

    __slots__ = ("_errors",)

    def __init__(self, priors: ErrorPriors) -> None:
        self._errors = ConsiderBiases(priors)

    def initiate(self, fix: GroundFix) -> StaticTargetState:
        """The belief after the first fix: the fix itself."""
        host_ns, errors = fix.sighting.frame_host_ns, self._errors
        return StaticTargetState(errors, first_estimate(errors.weighed(fix), errors.wandering), host_ns, host_ns)
