"""The Kalman filter of a target that stands still."""

from __future__ import annotations

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.nouns import ErrorPriors, GroundFix
from fwav_companion.tracking.estimate import blended, first_estimate, least_noise, noise_gain
from fwav_companion.tracking.shared import SharedErrors
from fwav_companion.tracking.standing import StandingBelief


class StaticBelief(StandingBelief, frozen=True):
    """Each fix weighed with its own covariance and with what it shares with those before."""

    def predicted(self, host_ns: HostNs) -> StaticBelief:
        """The target stays; only the vehicle's position error goes on wandering."""
        kept = self.errors.kept(self.host_ns, host_ns)
        return self if kept == 1.0 else StaticBelief(self.errors, self.estimate.faded(kept), host_ns, self.fixed_ns)

    def updated(self, fix: GroundFix) -> StaticBelief:
        """With the gain of least noise: the weighted mean of all fixes."""
        errors, estimate, host_ns = self.errors, self.estimate, fix.sighting.frame_host_ns
        weighed = errors.weighed_after(fix, s_from_ns(host_ns - self.fixed_ns), estimate.position)
        gain = noise_gain(estimate, weighed)
        noise = least_noise(estimate.noise, gain)
        return StaticBelief(errors, blended(estimate, weighed, gain, noise, errors.timed), self.host_ns, host_ns)


class StaticKalman:
    """Starts beliefs about standing targets."""

    __slots__ = ("_errors",)

    def __init__(self, priors: ErrorPriors) -> None:
        self._errors = SharedErrors(priors)

    def started(self, fix: GroundFix) -> StaticBelief:
        """The belief after the first fix: the fix itself."""
        host_ns, errors = fix.sighting.frame_host_ns, self._errors
        return StaticBelief(errors, first_estimate(errors.weighed(fix), errors.wandering), host_ns, host_ns)
