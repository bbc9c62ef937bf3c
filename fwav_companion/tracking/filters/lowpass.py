"""The paper's first-order low-pass, in the NED frame, so that it does not lag behind the vehicle's own motion.

With ``alpha_rate_hz`` = 0 it is the paper's recursion, u_k = alpha x_(k-1) + (1 - alpha) u_(k-1). Otherwise it is the
form for any interval, u_k = u_(k-1) + a (x_k - u_(k-1)) with a = 1 - (1 - alpha)^(dt alpha_rate_hz). Both start at
their first sample. The covariance is exact for the recursion, biases included: averaging does not remove them.
"""

from __future__ import annotations

from math import hypot, pow  # noqa: A004 - of floats, always a float
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.tracking.filters.averages import FixScatter, HeightAverage, PlaceAverage
from fwav_companion.tracking.filters.fix_sample import FixSample, FixSampler
from fwav_companion.tracking.filters.position_error import PositionError, PositionErrorModel
from fwav_companion.types import ErrorPriors, GroundFix
from fwav_companion.types.tracks import GateResult


class LowPass:
    """The low-pass filter: initiates targets, and computes the gain of a new sample."""

    __slots__ = ("alpha", "alpha_rate_hz", "position_errors", "sampler")

    def __init__(self, alpha: float, alpha_rate_hz: float, priors: ErrorPriors) -> None:
        self.alpha = alpha
        self.alpha_rate_hz = alpha_rate_hz
        self.sampler, self.position_errors = FixSampler(priors), PositionErrorModel(priors)

    def share(self, since_s: float) -> float:
        """The gain of a sample ``since_s`` seconds after the previous one."""
        if self.alpha_rate_hz == 0.0:
            return self.alpha
        return 1.0 - pow(1.0 - self.alpha, max(0.0, since_s) * self.alpha_rate_hz)

    def initiate(self, fix: GroundFix) -> LowPassTargetState:
        """The state after the first sample: u_0 = x_0."""
        sample, host_ns = self.sampler.sample(fix), fix.sighting.frame_host_ns
        (north, east, down), ((nn, ne, _), (_, ee, _), (_, _, dd)) = sample.position, sample.noise
        apparent = PlaceAverage(north, east, (nn, ne, ee), sample.shared[:2])
        return LowPassTargetState(
            filter=self,
            position_error=self.position_errors.at(fix.sighting.state),
            apparent=apparent,
            predicted=apparent,
            down=HeightAverage(down, dd, sample.shared[2]),
            fixed_ns=host_ns,
            host_ns=host_ns,
            waiting=sample if self.alpha_rate_hz == 0.0 else None,
        )


class LowPassTargetState(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """State of the low-pass: u_k and, in the paper's form, the sample x_k, which enters only with the next sample."""

    filter: LowPass
    position_error: PositionError
    """Error of the vehicle's position at the last fix."""
    apparent: PlaceAverage
    """u at the last fix: the place plus the error of the vehicle's position then, as in single fixes."""
    predicted: PlaceAverage
    """u predicted to ``host_ns``."""
    down: HeightAverage
    scatter: FixScatter = FixScatter()
    report_displacement: tuple[float, float] = (0.0, 0.0)
    """Displacement of the vehicle's report by one sigma of its delay, at the last fix, north and east, metres."""
    fixed_ns: HostNs
    """Capture of the last fix."""
    host_ns: HostNs
    waiting: FixSample | None = None
    velocity_ned: ClassVar[None] = None
    velocity_cov: ClassVar[None] = None

    @property
    def position_ned(self) -> Vector3:
        """The place, NED, metres."""
        return (self.apparent.north_m, self.apparent.east_m, self.down.down_m)

    @property
    def cov(self) -> Matrix3:
        """Covariance of the place, all sources of error included, NED, m^2."""
        return self._with_down(self._place)

    @property
    def apparent_ned(self) -> Vector3:
        """The place plus the present error of the vehicle's position, NED, metres."""
        return (self.predicted.north_m, self.predicted.east_m, self.down.down_m)

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the target relative to the vehicle, NED, m^2: noise and delay of its report count in full."""
        noise, (nn, ne, ee) = self.filter.sampler.priors.position_noise_m**2, self._report_lateness
        return self._with_down(self.predicted.with_noise((noise + nn, ne, noise + ee)))

    @property
    def _place(self) -> PlaceAverage:
        """The average with the whole prior of the position error, which less than a second does not average out."""
        variance = self.position_error.sigma_m**2
        return self.apparent.with_noise((variance, 0.0, variance))

    @property
    def _report_lateness(self) -> Symmetric2:
        """Covariance of the vehicle's report due to its position delay, m^2.

        Between fixes the course is not known: the vehicle is assumed to have the speed of the last fix in any
        direction.
        """
        north, east = self.report_displacement
        if self.host_ns == self.fixed_ns:
            return (north * north, north * east, east * east)
        each = 0.5 * (north * north + east * east)
        return (each, 0.0, each)

    def _with_down(self, place: PlaceAverage) -> Matrix3:
        """Covariance of a place and the height, NED, m^2."""
        (nn, ne, ee), (nd, ed), down = place.cov, place.along(self.down.shared), self.down
        return ((nn, ne, nd), (ne, ee, ed), (nd, ed, down.variance + hypot(*down.shared) ** 2))

    def shares_by_cause(self) -> dict[str, float]:
        """Horizontal variance of the place that it would lose if one cause of error were exactly known, m^2."""
        shares = self.filter.sampler.shares(self.apparent.shared)
        return {**shares, "position": 2.0 * self.position_error.sigma_m**2}

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix at this instant, horizontal."""
        sampler = self.filter.sampler
        return self.predicted.gate(sampler.sample(fix), self.scatter, sampler.time_offset)

    def predict(self, host_ns: HostNs) -> LowPassTargetState:
        """The state at a later instant: the target stays, the error of the vehicle's position wanders on."""
        return replace(self, host_ns=host_ns, predicted=self._predicted(host_ns))

    def _predicted(self, host_ns: HostNs) -> PlaceAverage:
        more = self.position_error.movement(s_from_ns(host_ns - self.fixed_ns))
        return self.apparent if more == 0.0 else self.apparent.with_noise((more, 0.0, more))

    def update(self, fix: GroundFix) -> LowPassTargetState:
        """One step of the recursion. u contains the position errors at the times of its samples."""
        low_pass, sampler, host_ns = self.filter, self.filter.sampler, fix.sighting.frame_host_ns
        since_s = s_from_ns(host_ns - self.fixed_ns)
        sample = sampler.next_sample(fix, since_s)
        entering, waiting = (self.waiting, sample) if low_pass.alpha_rate_hz == 0.0 else (sample, None)
        apparent, down = self.apparent, self.down
        if entering is not None:
            before, share = (
                self.predicted if host_ns == self.host_ns else self._predicted(host_ns),
                low_pass.share(since_s),
            )
            apparent, down = before.with_sample(entering, share), down.with_sample(entering, share)
        return replace(
            self,
            position_error=low_pass.position_errors.at(fix.sighting.state),
            apparent=apparent,
            predicted=apparent,
            down=down,
            scatter=self.apparent.scatter_after(sampler.sample(fix), self.scatter, sampler.time_offset),
            report_displacement=sampler.report_displacement(sample),
            fixed_ns=host_ns,
            host_ns=host_ns,
            waiting=waiting,
        )
