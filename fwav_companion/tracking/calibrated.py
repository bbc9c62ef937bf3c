"""A track as the joint estimate of self-calibration sees it."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.nouns import GroundFix
from fwav_companion.tracking.base import Belief
from fwav_companion.tracking.calibrator import Calibrator
from fwav_companion.tracking.estimate import Surprise
from fwav_companion.tracking.linear import Symmetric2
from fwav_companion.tracking.verdict import Placed


class CalibratedBelief(msgspec.Struct, frozen=True):
    """A track as the joint estimate sees it, heights by its own filter."""

    calibrator: Calibrator
    track: int
    placed: Placed
    own: Belief

    @property
    def position_ned(self) -> Vector3:
        """Metres."""
        return (self.placed.north, self.placed.east, self.own.position_ned[2])

    @property
    def cov(self) -> Matrix3:
        """Every source of error, m^2, NED."""
        return _level(self.placed.cov, self.own.cov[2][2])

    @property
    def relative_cov(self) -> Matrix3:
        """Without the vehicle's own position, m^2, NED."""
        return _level(self.placed.relative_cov, self.own.relative_cov[2][2])

    @property
    def velocity_ned(self) -> Vector3 | None:
        """A standing target has none to tell."""
        return None

    @property
    def velocity_cov(self) -> Matrix3 | None:
        """A standing target has none to tell."""
        return None

    def predicted(self, host_ns: HostNs) -> Belief:
        """The target stays."""
        return self.own.predicted(host_ns)

    def surprise(self, fix: GroundFix) -> Surprise:
        """How little a fix was expected in the image, with what calibration knows by now."""
        seen = self.calibrator.surprise(self.track, fix)
        return self.own.surprise(fix) if seen is None else seen

    def updated(self, fix: GroundFix) -> Belief:
        """Its own filter goes on beside the joint estimate."""
        return self.own.updated(fix)


def _level(horizontal: Symmetric2, down: float) -> Matrix3:
    nn, ne, ee = horizontal
    return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, down))
