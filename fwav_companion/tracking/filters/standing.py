"""State of a target that stands: what the Kalman filter and the low-pass have in common."""

from __future__ import annotations

from math import sqrt
from typing import Self

import msgspec
from msgspec.structs import replace

from fwav_companion.geometry.small_matrices import inner
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import ConsiderBiases
from fwav_companion.tracking.filters.position_wander import STEP_S, WanderingPlace, first_place, position_wander
from fwav_companion.tracking.filters.schmidt_kalman import DownEstimate, PointEstimate, gate_result
from fwav_companion.types import Bias, ErrorPriors, GroundFix
from fwav_companion.types.tracks import GateResult, GateShare


class StandingModel:
    """What all standing targets share: biases, and the wander of the vehicle's position. Immutable."""

    __slots__ = ("errors", "wander")

    def __init__(self, priors: ErrorPriors) -> None:
        self.errors = ConsiderBiases(priors, wandering=False)
        north, east = priors.sigma(Bias.POSITION_NORTH), priors.sigma(Bias.POSITION_EAST)
        self.wander = position_wander(sqrt(0.5 * (north * north + east * east)), priors.position_bias_time_s)


class StandingTargetState(msgspec.Struct, frozen=True, kw_only=True):
    """One standing target. A subclass updates it."""

    model: StandingModel
    apparent: PointEstimate
    """The place plus the present error of the vehicle's position: what single fixes agree with now."""
    predicted: PointEstimate | None = None
    """The same at ``host_ns``; None at the last fix."""
    wandering: WanderingPlace | None = None
    """The place apart from that error; None where positions are exact."""
    down: DownEstimate
    scatter: AdaptiveNoise = AdaptiveNoise()
    """Scatter of single fixes beyond their noise."""
    first_ns: HostNs
    """Capture of the first fix."""
    placed_ns: HostNs
    """Instant of ``wandering``."""
    fixed_ns: HostNs
    """Capture of the last fix."""
    host_ns: HostNs

    @property
    def position_ned(self) -> Vector3:
        """The place, NED, metres."""
        place = self._place
        return (place.north_m, place.east_m, self.down.down_m)

    @property
    def cov(self) -> Matrix3:
        """Covariance of the place by every source of error, NED, m^2."""
        return with_down(self._place, self.down)

    @property
    def apparent_ned(self) -> Vector3:
        """The place plus the present error of the vehicle's position, NED, metres."""
        place = self.relative
        return (place.north_m, place.east_m, self.down.down_m)

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the target relative to the vehicle, NED, m^2."""
        return with_down(self.relative, self.down)

    @property
    def relative(self) -> PointEstimate:
        """The place in the frame of the vehicle's report, whose own noise is unknown: all of it counts."""
        noise = self.model.errors.position_noise_m2
        return (self.predicted or self.apparent).with_noise((noise, 0.0, noise))

    @property
    def velocity_ned(self) -> Vector3 | None:
        """None: a standing target has no velocity."""
        return None

    @property
    def velocity_cov(self) -> Matrix3 | None:
        """None: a standing target has no velocity."""
        return None

    @property
    def _place(self) -> PointEstimate:
        return self.apparent if self.wandering is None else self.wandering.estimate

    @property
    def gate_share(self) -> GateShare:
        """The share of this target in the gate's variance."""
        apparent, scatter = self.predicted or self.apparent, self.scatter.variance
        nn, _, ee = apparent.noise
        return GateShare(nn + scatter, ee + scatter, *apparent.shared)

    def gate_share_of(self, fix: GroundFix) -> GateShare:
        """The share of a fix."""
        prepared = self.model.errors.prepared(fix)
        return GateShare(prepared.noise[0][0], prepared.noise[1][1], prepared.shared[0], prepared.shared[1])

    def predict(self, host_ns: HostNs) -> Self:
        """The state at a later instant: the target stays, the error of the vehicle's position wanders on."""
        return replace(self, host_ns=host_ns, predicted=self.before(host_ns))

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix at this instant, horizontal."""
        errors = self.model.errors
        return gate_result(self.predicted or self.apparent, self.scatter, errors.prepared(fix), errors.timed)

    def before(self, host_ns: HostNs) -> PointEstimate:
        """The apparent place predicted to an instant: the error of the vehicle's position has wandered on."""
        nn, _, ee = self.apparent.noise
        more = self.model.wander.apparent_noise(s_from_ns(host_ns - self.fixed_ns), 0.5 * (nn + ee))
        return self.apparent if more == 0.0 else self.apparent.with_noise((more, 0.0, more))

    def placed(self, apparent: PointEstimate, host_ns: HostNs) -> tuple[WanderingPlace | None, HostNs]:
        """The place by the newest apparent one, and its instant. Within the first second it is that one."""
        wander, since_s = self.model.wander, s_from_ns(host_ns - self.placed_ns)
        if self.wandering is None:
            return None, host_ns
        if s_from_ns(host_ns - self.first_ns) < STEP_S:
            return first_place(apparent, wander), host_ns
        if since_s < STEP_S:
            return self.wandering, self.placed_ns
        return self.wandering.update(apparent, wander, since_s), host_ns


def with_down(place: PointEstimate, down: DownEstimate) -> Matrix3:
    """The covariance of a point and its height, NED, m^2."""
    (nn, ne, ee), (n, e), d = place.cov, place.shared, down.shared
    if not any(d):
        return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, down.variance))
    nd, ed = inner(n, d), inner(e, d)
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, down.variance + inner(d, d)))
