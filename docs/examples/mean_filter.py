"""A filter of one's own: the mean of all fixes of a target, and the covariance of a single fix.

With this file in the current folder, a recorded flight is replayed with it by::

    fwav-companion replay flight/ --out targets.jsonl --allow-code --set tracking.filter=mean_filter:MeanFilter
"""

from __future__ import annotations

import msgspec

from fwav_companion.types import ErrorPriors, GroundFix
from fwav_companion.types.tracks import GateResult

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]


class MeanState(msgspec.Struct, frozen=True):
    """One target. Immutable: each method returns a new state."""

    position_ned: Vector
    """Place, NED, metres."""
    fix: GroundFix
    count: int = 1

    @property
    def cov(self) -> Matrix:
        """Covariance of the place by every error, m^2. Biases do not average out: that of one fix is honest."""
        return self.fix.cov

    @property
    def apparent_ned(self) -> Vector:
        """The place in the frame of the vehicle's own reports, which LANDING_TARGET uses."""
        return self.position_ned

    @property
    def relative_cov(self) -> Matrix:
        """Covariance of the target relative to the vehicle, m^2."""
        return self.fix.cov

    @property
    def velocity_ned(self) -> None:
        """None: the target stands."""
        return None

    @property
    def velocity_cov(self) -> None:
        """None: the target stands."""
        return None

    def predict(self, host_ns: int) -> MeanState:
        """The state at a later instant: the target stays."""
        return self

    def gate(self, fix: GroundFix) -> GateResult:
        """The normalised innovation squared of a fix, by north and east alone; a fix beyond 16 is another target's."""
        north, east = (a - b for a, b in zip(fix.position_ned[:2], self.position_ned[:2], strict=True))
        return GateResult(nis=north * north / fix.cov[0][0] + east * east / fix.cov[1][1], log_det_ratio=0.0)

    def update(self, fix: GroundFix) -> MeanState:
        """The state after a fix of this target."""
        count = self.count + 1
        north, east, down = (
            mean + (new - mean) / count for mean, new in zip(self.position_ned, fix.position_ned, strict=True)
        )
        return MeanState((north, east, down), fix, count)


class MeanFilter:
    """Made once, with the sigmas of [uncertainty]."""

    def __init__(self, priors: ErrorPriors) -> None:
        self.priors = priors

    def initiate(self, fix: GroundFix) -> MeanState:
        """The state after the first fix of a target."""
        return MeanState(fix.position_ned, fix)
