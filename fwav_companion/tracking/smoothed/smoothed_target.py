"""Targets by the smoother's live filter, at one frame."""

from __future__ import annotations

from math import sqrt

import msgspec

from fwav_companion.estimation.answers import TargetAnswer
from fwav_companion.estimation.errors import MOUNT, PITCH, ROLL, Array
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.variance_shares import variance_shares
from fwav_companion.geometry.rotations import rotate
from fwav_companion.geometry.vectors import Matrix3, Vector3, add
from fwav_companion.tracking.smoothed.smoothed_track import SmoothedTrack
from fwav_companion.types import FrameView, GroundFix
from fwav_companion.types.tracks import OUTSIDE_GATE, GateResult

CLIMB_SIGMA_M_S = 0.3
"""One sigma of a moving target's vertical velocity, m/s: targets are on the ground."""


class SmoothedTarget(msgspec.Struct, frozen=True):
    """A target by the live filter at one frame. On flat ground its height is that of the ground, by its last fix."""

    frame: FrameAnswers
    track: int
    """Its number in the estimator."""
    answer: TargetAnswer
    vehicle_ned: Vector3
    """Vehicle's reported position, NED, metres."""
    lever_ned: Vector3
    """From the reported position to the camera, NED, metres."""
    last_fix: GroundFix
    """Gives the height of flat ground."""
    moving: bool

    @property
    def position_ned(self) -> Vector3:
        """Position in NED, metres."""
        north, east, up = self.answer.place.tolist()
        return (north, east, self._down(-up))

    @property
    def cov(self) -> Matrix3:
        """Covariance of the position by every source of error, NED, m^2."""
        return self._ned(self.answer.covariance)

    @property
    def apparent_ned(self) -> Vector3:
        """The reported vehicle plus the target relative to it, NED, metres."""
        north, east, down = add(self.vehicle_ned, self.lever_ned)
        to_north, to_east, up = self.answer.relative.tolist()
        return (north + to_north, east + to_east, self._down(down - up))

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the target relative to the vehicle, NED, m^2."""
        return self._ned(self.answer.relative_covariance)

    def _down(self, of_point_m: float) -> float:
        if not self.frame.is_mapped:
            return self.last_fix.position_ned[2]
        return of_point_m + self.frame.point_height_m(self.track)

    def _ned(self, covariance: Array) -> Matrix3:
        (nn, ne, nu), (_, ee, eu), (_, _, uu) = covariance.tolist()
        if not self.frame.is_mapped:
            return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, self.last_fix.noise_cov[2][2]))
        return ((nn, ne, -nu), (ne, ee, -eu), (-nu, -eu, uu))

    def shares_by_cause(self) -> dict[str, float]:
        """Horizontal variance that it would lose if one cause of error were exactly known, by cause, m^2."""
        return self.frame.shares(self.track)

    @property
    def velocity_ned(self) -> Vector3 | None:
        """Velocity, NED, m/s; None for a static target."""
        north, east = self.answer.velocity.tolist()
        return (north, east, 0.0) if self.moving else None

    @property
    def velocity_cov(self) -> Matrix3 | None:
        """Covariance of the velocity, NED, (m/s)^2; None for a static target."""
        if not self.moving:
            return None
        (nn, ne), (_, ee) = self.answer.velocity_covariance.tolist()
        return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, CLIMB_SIGMA_M_S**2))


class FrameAnswers:
    """The smoother's answers at one frame's capture."""

    __slots__ = ("_estimator", "_lever_ned", "_targets", "_vehicle_ned", "gates", "is_mapped", "t")

    def __init__(
        self, estimator: Estimator, t: float, view: FrameView, lever_m: Vector3, *, is_mapped: bool = False
    ) -> None:
        """``t``: capture of row 0, seconds on the autopilot's clock. ``lever_m``: to the camera, body axes, metres.

        ``is_mapped``: whether the ground is an elevation model.
        """
        self._estimator, self.t, self.is_mapped = estimator, t, is_mapped
        self._lever_ned: Vector3 = (0.0, 0.0, 0.0)
        if view.vehicle is not None and view.vehicle_ned is not None:
            self._lever_ned = rotate(view.vehicle.ned_from_body, lever_m)
        self._vehicle_ned = view.vehicle_ned
        self._targets: dict[tuple[int, int], SmoothedTarget | None] = {}
        self.gates: dict[tuple[int, int], GateResult] = {}
        """Gating statistics by track id and fix index, each pair by itself."""

    def forget(self) -> None:
        """Compute the answers again: the estimator has changed."""
        self._targets.clear()

    def gate(self, track: int, fix: int) -> GateResult:
        """Gating statistics of a fix of this frame."""
        return self.gates.get((track, fix), OUTSIDE_GATE)

    def target(self, track: SmoothedTrack) -> SmoothedTarget | None:
        """The track's target; None where the live filter does not hold it."""
        key = (track.id, id(track.last_fix))
        if key not in self._targets:
            self._targets[key] = self._target(track)
        return self._targets[key]

    def _target(self, track: SmoothedTrack) -> SmoothedTarget | None:
        answer, live = self._estimator.answer(track.id, self.t), self._estimator.live
        if answer is None or live is None:
            return None
        vehicle = self._vehicle_ned
        if vehicle is None:
            north, east, height = live.poses.motion(self.t).at(self.t).tolist()
            vehicle = (north, east, -height)
        return SmoothedTarget(self, track.id, answer, vehicle, self._lever_ned, track.last_fix, track.moving)

    def point_height_m(self, target: int) -> float:
        """Height of a target's detected point above its foot, metres."""
        return self._estimator.model.target(target).height_m

    def shares(self, target: int) -> dict[str, float]:
        """Horizontal variance of a target by cause, m^2."""
        return variance_shares(self._estimator.live, target)

    def displaced_m(self, track: SmoothedTrack) -> float:
        """Distance by which the estimated mount and tilt displace a target from where the configuration expects it."""
        live = self._estimator.live
        if live is None:
            return 0.0
        turn = live.mean[MOUNT].copy()
        turn[0] += live.mean[ROLL]
        turn[1] += live.mean[PITCH]
        return track.slant_m * sqrt(float(turn @ turn))
