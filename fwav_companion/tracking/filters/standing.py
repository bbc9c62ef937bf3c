"""What the filters of a target that stands still have in common."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.tracking.filters.consider_biases import ConsiderBiases
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate, gate_result
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateResult, GateShare


class StandingTargetState(msgspec.Struct, frozen=True):
    """A standing target: where it is and by what that may be wrong."""

    errors: ConsiderBiases
    estimate: PointEstimate
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
    def apparent_ned(self) -> Vector3:
        """The position itself: the present error of the vehicle's position is not estimated."""
        return self.estimate.position

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

    @property
    def gate_share(self) -> GateShare:
        """The share of this target in the gate's variance."""
        estimate = self.estimate
        nn, _, ee = estimate.forgotten
        (p_nn, _, _), (_, p_ee, _), _ = estimate.noise
        scatter = estimate.scatter.variance
        return GateShare(p_nn + nn + scatter, p_ee + ee + scatter, estimate.shared[0], estimate.shared[1])

    def gate_share_of(self, fix: GroundFix) -> GateShare:
        """The share of a fix."""
        weighed = self.errors.weighed(fix)
        return GateShare(weighed.noise[0][0], weighed.noise[1][1], weighed.shared[0], weighed.shared[1])

    def gate(self, fix: GroundFix) -> GateResult:
        """How little a fix at this instant was expected, horizontal."""
        errors = self.errors
        return gate_result(self.estimate, errors.weighed(fix), errors.timed)
