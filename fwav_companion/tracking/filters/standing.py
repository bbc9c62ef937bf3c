"""State of a static target: the common base of the Kalman filter's state and of the low-pass's."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf, sqrt
from typing import ClassVar, Self

import msgspec
from msgspec.structs import replace

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.geometry.stamps import HostNs, ns_from_s, s_from_ns
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.base import SharedInnovation, TargetEstimate
from fwav_companion.tracking.filters.consider_biases import BiasShare, ConsiderBiases, Measurement
from fwav_companion.tracking.filters.fix_mean import FixMean, first_mean
from fwav_companion.tracking.filters.gate_results import gate_results
from fwav_companion.tracking.filters.position_wander import (
    PositionWander,
    WanderingPlace,
    first_place,
    first_place_estimate,
    position_wander,
)
from fwav_companion.tracking.filters.relative_estimate import RelativeEstimate
from fwav_companion.tracking.filters.schmidt_kalman import DownEstimate, PointEstimate, difference
from fwav_companion.tracking.filters.wander_evidence import NO_EVIDENCE, STEP_S, WanderEvidence
from fwav_companion.types import Bias, ErrorPriors, GroundFix
from fwav_companion.types.tracks import GateResult, GateShare

FRESH_SHARE = 0.5
"""Ratio of a receiver's sigma to its earlier one, up to which its error is a new one: it has found another solution."""

SHOWN_SMOOTH = 0.95
"""Probability of a smooth error above which its rate predicts its movement: a first-order error has no rate."""
SPREAD = 0.618
"""Step between the update instants of the targets of one frame, seconds: multiples of the golden section spread evenly
over a second for any number of targets."""


DRIFT_TIMES_S = (inf,)
"""Time constants of an error that drifts: it never returns."""


class StandingModel:
    """Model of the errors that all static targets share: biases, and wander of the vehicle's position. Immutable."""

    __slots__ = ("_times_s", "errors", "wander")

    def __init__(self, priors: ErrorPriors) -> None:
        self.errors = ConsiderBiases(priors, wandering=False)
        north, east = priors.sigma(Bias.POSITION_NORTH), priors.sigma(Bias.POSITION_EAST)
        self._times_s = priors.position_times_s
        self.wander = position_wander(sqrt(0.5 * (north * north + east * east)), self._times_s)

    def wander_at(self, fix: GroundFix) -> PositionWander:
        """The wander with the sigma that the receiver reports at this fix; without a report, the configured one."""
        sigma_m = fix.sighting.state.position_bias_m
        if fix.sighting.state.position_drifts and sigma_m:
            return position_wander(sigma_m, DRIFT_TIMES_S)
        if sigma_m is None or sigma_m == self.wander.sigma_m or self.wander.sigma_m == 0.0:
            return self.wander
        return position_wander(sigma_m, self._times_s)


class StandingTargetState(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """State of one static target. A subclass implements its update."""

    model: StandingModel
    wander: PositionWander
    """Wander of the vehicle's position at the last fix."""
    apparent: PointEstimate
    """Apparent place at the last fix: the place plus the error of the vehicle's position then, as in single fixes."""
    predicted: PointEstimate
    """Apparent place predicted to ``host_ns``."""
    now: RelativeEstimate | None = None
    """The place in the frame of the vehicle's report at a fix of this instant; None without such a fix, and always for
    the low-pass."""
    wandering: WanderingPlace | None = None
    """Separate estimates of the place and of that error; None where positions are exact, and before ``apart_ns``."""
    wander_evidence: WanderEvidence | None = None
    """Evidence whether that error moves smoothly, shared by all targets of the vehicle. None in the first second of a
    flight."""
    fresh: FixMean | None = None
    """Mean of the fixes since ``placed_ns``, with which the place is updated next; None before the first. The apparent
    place cannot replace it, because it contains earlier fixes, too, and these would count again."""
    down: DownEstimate
    scatter: AdaptiveNoise = AdaptiveNoise()
    """Scatter of single fixes beyond their noise."""
    late: BiasShare | None = None
    """Displacement of the vehicle's report by one sigma of the position delay, at the last fix."""
    apart_ns: HostNs
    """Instant from which the place is estimated separately from the apparent place."""
    placed_ns: HostNs
    """Instant of the last update of ``wandering``."""
    fixed_ns: HostNs
    """Capture of the last fix."""
    host_ns: HostNs
    velocity_ned: ClassVar[None] = None
    velocity_cov: ClassVar[None] = None

    @property
    def position_ned(self) -> Vector3:
        """The place, NED, metres."""
        if self.wandering is not None:
            return (self.wandering.north[0][0], self.wandering.east[0][0], self.down.down_m)
        return (self.apparent.north_m, self.apparent.east_m, self.down.down_m)

    @property
    def cov(self) -> Matrix3:
        """Covariance of the place, all sources of error included, NED, m^2."""
        place = self._place
        return with_down(place.cov, place.along(self.down.shared), self.down)

    @property
    def apparent_ned(self) -> Vector3:
        """The place plus the present error of the vehicle's position, NED, metres."""
        place = self.now or self.predicted
        return (place.north_m, place.east_m, self.down.down_m)

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the target relative to the vehicle, NED, m^2.

        Without a fix at this instant, noise and delay of the report are unknown: both count in full.
        """
        if self.now is not None:
            return with_down(self.now.cov, self.now.down_cov, self.down)
        noise, (nn, ne, ee) = self.model.errors.priors.position_noise_m**2, self.report_lateness()
        place = self.predicted.with_noise((noise + nn, ne, noise + ee))
        return with_down(place.cov, place.along(self.down.shared), self.down)

    def report_lateness(self, share: float = 1.0) -> Symmetric2:
        """Covariance of the vehicle's report due to its position delay, m^2. ``share``: of the delay's prior variance.

        Between fixes the course is not known: the vehicle is assumed to have the speed of the last fix in any
        direction.
        """
        if self.late is None:
            return (0.0, 0.0, 0.0)
        _, north, east = self.late
        if self.host_ns == self.fixed_ns:
            return (share * north * north, share * north * east, share * east * east)
        each = 0.5 * share * (north * north + east * east)
        return (each, 0.0, each)

    @property
    def _place(self) -> PointEstimate:
        if self.wandering is not None:
            return self.wandering.estimate
        return self.apparent if self.wander.sigma_m == 0.0 else first_place_estimate(self.apparent, self.wander)

    def bias_shares(self) -> dict[Bias, float]:
        """Horizontal variance of the place due to each bias, m^2: it would vanish if that bias were exactly known."""
        place, (nn, _, ee) = self._place, self.apparent.noise
        position = max(0.0, place.noise[0] + place.noise[2] - nn - ee)
        return self.model.errors.shares(place.shared) | {Bias.POSITION_NORTH: position}

    @property
    def gate_share(self) -> GateShare:
        """Share of this target in the variance of an innovation."""
        predicted, scatter = self.predicted, self.scatter.variance
        nn, _, ee = predicted.noise
        north, east = predicted.shared
        return GateShare(nn + scatter, ee + scatter, north, east)

    def gate_share_of(self, fix: GroundFix) -> GateShare:
        """Share of a fix in the variance of an innovation."""
        prepared = self.model.errors.prepared(fix)
        ((nn, _, _), (_, ee, _), _), (north, east, _) = prepared.noise, prepared.shared
        return GateShare(nn, ee, north, east)

    def predict(self, host_ns: HostNs) -> Self:
        """The state at a later instant: the target stays, the error of the vehicle's position wanders on."""
        return replace(self, host_ns=host_ns, predicted=self._predicted(host_ns), now=None)

    def jumped(self, jump_m: float) -> Self:
        """The state after a jump of the vehicle's position by up to ``jump_m`` along each axis."""
        if self.wandering is None:
            return self
        variance = jump_m * jump_m
        apparent = self.apparent.with_noise((variance, 0.0, variance))
        wandering = self.wandering.with_jump(variance)
        return replace(self, apparent=apparent, predicted=apparent, fresh=None, wandering=wandering)

    def drifted(self, variance: float) -> Self:
        """The state after a drift of the vehicle's position by this variance along each axis, m^2.

        The place stays where the first fixes had it: an error that does not return has no mean to average to.
        """
        apparent = self.apparent.with_noise((variance, 0.0, variance))
        wandering = None if self.wandering is None else self.wandering.with_drift(variance)
        state = replace(self, apparent=apparent, wandering=wandering)
        return replace(state, predicted=state._predicted(self.host_ns))

    def placed_on_earth(self, sigma_m: float) -> Self:
        """The state after the world's zero got a place on the earth, with this one sigma along each axis.

        Every target is off by the same error then, and the vehicle's position by its opposite: single fixes agree with
        the apparent place as before.
        """
        if self.wandering is None:
            return self
        return replace(self, wandering=self.wandering.with_shifted_frame(sigma_m * sigma_m))

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix at this instant, horizontal."""
        return self.gates((fix,))[0]

    def gates(self, fixes: Sequence[GroundFix]) -> list[GateResult]:
        """Gating statistics of several fixes."""
        errors = self.model.errors
        return gate_results(self.predicted, self.scatter, [errors.prepared(fix) for fix in fixes], errors.timed)

    def innovation(self, fix: GroundFix) -> SharedInnovation:
        """The innovation of a fix at this instant. Its sensitivities include the scatter by the time offset.

        The vehicle's position has wandered since the last fix, equally for all targets: these are two more
        sensitivities.
        """
        own, seen = self.apparent, self.model.errors.prepared(fix)
        d_n, d_e = difference(seen.shared, own.shared)
        wandered = sqrt(max(0.0, self.predicted.noise[0] - own.noise[0]))
        (nn, ne, ee), ((r_nn, r_ne, _), (_, r_ee, _), _) = own.noise, seen.noise
        return SharedInnovation(
            seen.position[0] - own.north_m,
            seen.position[1] - own.east_m,
            ((*d_n, wandered, 0.0), (*d_e, 0.0, wandered)),
            (nn + r_nn, ne + r_ne, ee + r_ee),
        )

    def before(self, host_ns: HostNs) -> PointEstimate:
        """The apparent place predicted to an instant."""
        return self.predicted if host_ns == self.host_ns else self._predicted(host_ns)

    def _predicted(self, host_ns: HostNs) -> PointEstimate:
        """The apparent place predicted from the last fix: the error of the vehicle's position has wandered on.

        In the first second of a flight the kind of wander is not known yet: the wider covariance is used.
        """
        nn, _, ee = self.apparent.noise
        since_s = s_from_ns(host_ns - self.fixed_ns)
        smooth_share = 0.0 if self.wander_evidence is None else self.wander_evidence.smooth_share
        if since_s > STEP_S and smooth_share > SHOWN_SMOOTH and self.wandering is not None:
            return self.apparent.moved(*self.wandering.movement(self.wander, since_s))
        more = self.wander.apparent_noise(since_s, 0.5 * (nn + ee), smooth_share)
        return self.apparent if more == 0.0 else self.apparent.with_noise((more, 0.0, more))

    def under(self, wander: PositionWander) -> Self:
        """The state after a change of the receiver's accuracy to that of ``wander``.

        A better solution has an error of its own, independent of the old one. The error of a worse solution grows from
        the present error, as the process does.
        """
        if wander == self.wander:
            return self
        state = replace(self, wander=wander)
        if len(wander.rates) != len(self.wander.rates):
            known = self.wandering
            return replace(state, wandering=None if known is None else known.with_processes(wander))
        if wander.is_constant and wander.sigma_m >= self.wander.sigma_m:
            return state.drifted(wander.sigma_m**2 - self.wander.sigma_m**2)
        if self.wander.sigma_m == 0.0 or not wander.sigma_m <= FRESH_SHARE * self.wander.sigma_m:
            return replace(state, predicted=state._predicted(self.host_ns))
        known = self.wandering or first_place(self.apparent, self.wander)
        variance, place = wander.sigma_m**2, known.estimate
        apparent = place.with_noise((variance, 0.0, variance))
        state = replace(state, apparent=apparent, fresh=None, wandering=known.with_fresh_error(wander))
        return replace(state, predicted=state._predicted(self.host_ns))

    def placed(
        self, measurement: Measurement, noise: Matrix3, host_ns: HostNs
    ) -> tuple[WanderingPlace | None, FixMean | None, HostNs, WanderEvidence | None]:
        """``wandering``, ``fresh``, ``placed_ns`` and ``wander_evidence`` after the newest fix.

        Before ``apart_ns`` the place is the apparent one. ``noise``: of the fix without the error of its sensitivities.
        """
        if self.wander.sigma_m == 0.0 or host_ns < self.apart_ns:
            return None, None, host_ns, self.wander_evidence
        evidence = self.wander_evidence or NO_EVIDENCE
        wandering = self.wandering or first_place(self.apparent, self.wander)
        fresh, since_s = self.fresh, s_from_ns(host_ns - self.placed_ns)
        fresh = first_mean(measurement, noise) if fresh is None else fresh.with_fix(measurement, noise)
        if since_s < STEP_S:
            return wandering, fresh, self.placed_ns, evidence
        wandering = wandering.update(fresh.place, self.wander, since_s, fresh.mean)
        densities = self.wander.quick_density, self.wander.smooth_density
        return wandering, None, host_ns, evidence.with_means(wandering.means, *densities, host_ns)


def gates_of(target: TargetEstimate, fixes: Sequence[GroundFix]) -> Sequence[GateResult]:
    """Gating statistics of several fixes, computed together for a static target."""
    return target.gates(fixes) if isinstance(target, StandingTargetState) else [target.gate(fix) for fix in fixes]


def apart_at(fix: GroundFix) -> HostNs:
    """Instant from which the place of a target with this first fix is estimated separately from the apparent place.

    It is one to two seconds after the first fix. The targets of one frame get different instants, so that their
    expensive updates do not fall into the same frame.
    """
    sighting = fix.sighting
    return HostNs(sighting.frame_host_ns + ns_from_s(STEP_S * (1.0 + SPREAD * sighting.index % 1.0)))


def with_down(cov: Symmetric2, down_cov: tuple[float, float], down: DownEstimate) -> Matrix3:
    """Covariance of a point and its height, NED, m^2. ``down_cov``: covariance of north and east with the height."""
    (nn, ne, ee), (nd, ed) = cov, down_cov
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, down.variance + hypot(*down.shared) ** 2))
