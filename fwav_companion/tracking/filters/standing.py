"""State of a target that stands: what the Kalman filter and the low-pass have in common."""

from __future__ import annotations

from math import hypot
from typing import Self

import msgspec
from msgspec.structs import replace

from fwav_companion.geometry.small_matrices import inner
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.tracking.filters.adaptive_noise import AdaptiveNoise
from fwav_companion.tracking.filters.consider_biases import ConsiderBiases
from fwav_companion.tracking.filters.position_wander import PositionWander, position_wander
from fwav_companion.tracking.filters.schmidt_kalman import (
    DownEstimate,
    PlaceEstimate,
    StandingEstimate,
    gate_result,
)
from fwav_companion.types import Bias, ErrorPriors, GroundFix
from fwav_companion.types.tracks import GateResult

WANDER_STEP_S = 0.1
"""Least interval of a prediction: within it the position error of 1 m over 60 s moves by 3 mm."""


class StandingModel:
    """What all standing targets share: biases, and the wander of the vehicle's position. Immutable."""

    __slots__ = ("errors", "wander")

    def __init__(self, priors: ErrorPriors) -> None:
        self.errors = ConsiderBiases(priors, wandering=False)
        sigma_m = hypot(priors.sigma(Bias.POSITION_NORTH), priors.sigma(Bias.POSITION_EAST)) / 2.0**0.5
        self.wander: PositionWander = position_wander(sigma_m, priors.position_bias_time_s)


class StandingTargetState(msgspec.Struct, frozen=True, kw_only=True):
    """One standing target. A subclass updates it."""

    model: StandingModel
    estimate: StandingEstimate
    down: DownEstimate
    scatter: AdaptiveNoise = AdaptiveNoise()
    """Scatter of single fixes beyond their noise."""
    host_ns: HostNs
    """Instant of the estimate."""
    fixed_ns: HostNs
    """Capture of the last fix."""

    @property
    def position_ned(self) -> Vector3:
        """The place, NED, metres."""
        place = self.estimate.place
        return (place.north_m, place.east_m, self.down.down_m)

    @property
    def cov(self) -> Matrix3:
        """Covariance of the place by every source of error, NED, m^2."""
        return _with_down(self.estimate.place, self.down)

    @property
    def apparent_ned(self) -> Vector3:
        """The place plus the present error of the vehicle's position, NED, metres."""
        place = self.relative
        return (place.north_m, place.east_m, self.down.down_m)

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the target relative to the vehicle, NED, m^2."""
        return _with_down(self.relative, self.down)

    @property
    def relative(self) -> PlaceEstimate:
        """The place in the frame of the vehicle's report, whose own noise is unknown: all of it counts."""
        apparent, noise = self.estimate.apparent, self.model.errors.position_noise_m2
        nn, ne, ee = apparent.noise
        return PlaceEstimate(apparent.north_m, apparent.east_m, (nn + noise, ne, ee + noise), apparent.shared)

    @property
    def velocity_ned(self) -> Vector3 | None:
        """None: a standing target has no velocity."""
        return None

    @property
    def velocity_cov(self) -> Matrix3 | None:
        """None: a standing target has no velocity."""
        return None

    def predict(self, host_ns: HostNs) -> Self:
        """The state at a later instant: the target stays, the error of the vehicle's position wanders on."""
        interval_s = s_from_ns(host_ns - self.host_ns)
        if interval_s < WANDER_STEP_S:
            return self
        return replace(self, estimate=self.estimate.predict(self.model.wander, interval_s), host_ns=host_ns)

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix at this instant, horizontal."""
        errors = self.model.errors
        return gate_result(self.estimate.apparent, self.scatter, errors.prepared(fix), errors.timed)


def _with_down(place: PlaceEstimate, down: DownEstimate) -> Matrix3:
    (nn, ne, ee), (n, e), d = place.cov, place.shared, down.shared
    if not any(d):
        return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, down.variance))
    nd, ed = inner(n, d), inner(e, d)
    return ((nn, ne, nd), (ne, ee, ed), (nd, ed, down.variance + inner(d, d)))
