"""The Kalman filter of a target that stands still."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.nouns import ErrorPriors, GroundFix
from fwav_companion.tracking.estimate import (
    Estimate,
    Surprise,
    blended,
    first_estimate,
    least_noise,
    noise_gain,
    surprise,
)
from fwav_companion.tracking.shared import SharedErrors


class StaticBelief(msgspec.Struct, frozen=True):
    """A standing target: each fix weighed with its own covariance and with what it shares with those before."""

    errors: SharedErrors
    estimate: Estimate
    host_ns: HostNs
    """The instant that the wandering biases stand at."""
    fixed_ns: HostNs
    """Of the last fix."""

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
        """A standing target has none to tell."""
        return None

    @property
    def velocity_cov(self) -> Matrix3 | None:
        """A standing target has none to tell."""
        return None

    def predicted(self, host_ns: HostNs) -> StaticBelief:
        """The target stays; only the vehicle's position error goes on wandering."""
        was = self.estimate
        shared = self.errors.faded(was.shared, self.host_ns, host_ns)
        if shared is was.shared:
            return self
        estimate = Estimate(was.position, was.noise, shared, was.wandering, was.wander, was.scatter)
        return StaticBelief(self.errors, estimate, host_ns, self.fixed_ns)

    def surprise(self, fix: GroundFix) -> Surprise:
        """How little a fix at this instant was expected, horizontal."""
        return surprise(self.estimate, self.errors.weighed(fix, None), self.errors.timed)

    def updated(self, fix: GroundFix) -> StaticBelief:
        """With the gain of least noise: the weighted mean of all fixes."""
        host_ns = fix.sighting.frame_host_ns
        weighed = self.errors.weighed(fix, s_from_ns(host_ns - self.fixed_ns))
        gain = noise_gain(self.estimate, weighed)
        return StaticBelief(
            self.errors,
            blended(self.estimate, weighed, gain, least_noise(self.estimate.noise, gain), self.errors.timed),
            self.host_ns,
            host_ns,
        )


class StaticKalman:
    """Starts beliefs about standing targets."""

    __slots__ = ("_errors",)

    def __init__(self, priors: ErrorPriors) -> None:
        self._errors = SharedErrors(priors)

    def started(self, fix: GroundFix) -> StaticBelief:
        """The belief after the first fix: the fix itself."""
        host_ns, errors = fix.sighting.frame_host_ns, self._errors
        estimate = first_estimate(errors.weighed(fix, None), errors.wandering)
        return StaticBelief(errors, estimate, host_ns, host_ns)
