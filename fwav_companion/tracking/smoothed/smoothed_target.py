"""Targets by the smoother's live filter, at one frame."""

from __future__ import annotations

from collections.abc import Sequence
from math import log, pi, prod

import msgspec

from fwav_companion.estimation.answers import TargetAnswer
from fwav_companion.estimation.errors import Array
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.frame_prediction import GATE2, FramePrediction
from fwav_companion.estimation.variance_shares import variance_shares
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.tracking.clutter import noise_area_px2
from fwav_companion.tracking.filters.base import TargetEstimate, TargetState
from fwav_companion.tracking.self_calibrated import TargetChoice
from fwav_companion.tracking.track_state import LiveTrack
from fwav_companion.types import FrameView, GroundFix
from fwav_companion.types.tracks import OUTSIDE_GATE, GateResult


class FrameAnswers:
    """The smoother's answers at one frame: predicted measurements, and places at its capture."""

    __slots__ = ("_estimator", "_gates", "camera_from_vehicle", "is_mapped", "t", "vehicle_ned")

    def __init__(self, estimator: Estimator, t: float, view: FrameView, *, is_mapped: bool = False) -> None:
        """``t``: capture of row 0, seconds on the autopilot's clock. ``is_mapped``: by an elevation model."""
        self._estimator, self.t, self.is_mapped = estimator, t, is_mapped
        self.vehicle_ned = view.vehicle_ned
        self.camera_from_vehicle: Vector3 = (0.0, 0.0, 0.0)
        at_row = view.fixes[0].sighting if view.fixes else None
        if at_row is not None and at_row.state.position_ned is not None:
            camera, vehicle = at_row.camera_ned, at_row.state.position_ned
            self.camera_from_vehicle = (camera[0] - vehicle[0], camera[1] - vehicle[1], camera[2] - vehicle[2])
        self._gates: dict[tuple[int, int], GateResult] = {}

    def add_gates(self, fixes: Sequence[GroundFix], prediction: FramePrediction) -> None:
        """Add the gating statistics of the frame's pairs; of those with a rival, given the pairs without one.

        Targets that are displaced alike by a shared error are one surprise: a pair must agree with the others'.
        """
        certain = prediction.unambiguous()
        if len(certain) and len(certain) < int((prediction.distance2 < GATE2).sum()):
            prediction = prediction.given(certain)
        # A detection's pixel noise is the unit of its residual; clutter is compared with all of a fix's own noise.
        own = [2.0 * log(noise_area_px2(fix) / (2.0 * pi * prod(fix.sighting.pixel_sigma))) for fix in fixes]
        rows = zip(
            prediction.detection.tolist(), prediction.target.tolist(), prediction.visible.tolist(),
            prediction.distance2.tolist(), prediction.log_det.tolist(), strict=True,
        )  # fmt: skip
        for detection, target, visible, distance2, log_det in rows:
            if visible:
                self._gates[target, id(fixes[detection])] = GateResult(distance2, log_det - own[detection])

    def gate(self, target: int, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix of this frame."""
        return self._gates.get((target, id(fix)), OUTSIDE_GATE)

    def point_height_m(self, target: int) -> float:
        """Height of a target's detected point above its foot, metres."""
        return self._estimator.model.target(target).height_m

    def shares(self, target: int) -> dict[str, float]:
        """Horizontal variance of a target by cause, m^2."""
        return variance_shares(self._estimator.live, target)

    def answer(self, target: int) -> TargetAnswer | None:
        """A target at the frame's capture; None where the smoother does not hold it."""
        return None if self.vehicle_ned is None else self._estimator.answer(target, self.t)


class SmoothedTarget(msgspec.Struct, frozen=True):
    """A static target by the smoother. On flat ground its height is that of the ground, by its own filter."""

    frame: FrameAnswers
    track: int
    own: TargetState
    answer: TargetAnswer
    velocity_ned: Vector3 | None = None
    velocity_cov: Matrix3 | None = None

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
        vehicle, lever = self.frame.vehicle_ned or (0.0, 0.0, 0.0), self.frame.camera_from_vehicle
        north, east, up = self.answer.relative.tolist()
        down = self._down(vehicle[2] + lever[2] - up)
        return (north + vehicle[0] + lever[0], east + vehicle[1] + lever[1], down)

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the target relative to the vehicle, NED, m^2."""
        return self._ned(self.answer.relative_covariance)

    def _down(self, of_point_m: float) -> float:
        if not self.frame.is_mapped:
            return self.own.position_ned[2]
        return of_point_m + self.frame.point_height_m(self.track)

    def _ned(self, covariance: Array) -> Matrix3:
        (nn, ne, nu), (_, ee, eu), (_, _, uu) = covariance.tolist()
        if not self.frame.is_mapped:
            return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, self.own.cov[2][2]))
        return ((nn, ne, -nu), (ne, ee, -eu), (-nu, -eu, uu))

    def shares_by_cause(self) -> dict[str, float]:
        """Horizontal variance that it would lose if one cause of error were exactly known, by cause, m^2."""
        return self.frame.shares(self.track)

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix of this frame, by the live posterior."""
        return self.frame.gate(self.track, fix)

    def predict(self, host_ns: HostNs) -> TargetState:
        """The own filter's state at a later instant: the smoother predicts for itself."""
        return self.own.predict(host_ns)

    def update(self, fix: GroundFix) -> TargetState:
        """The own filter's state after a fix."""
        return self.own.update(fix)


class SmoothedChoice(TargetChoice, frozen=True, kw_only=True):
    """Reports by the smoother where it holds the target, else by the track's own filter."""

    frame: FrameAnswers

    def target(self, track: LiveTrack) -> TargetEstimate:
        """The target as it is reported."""
        return self._smoothed(track) or track.target

    def gated(self, track: LiveTrack) -> TargetState:
        """The target that gates fixes in the association."""
        return self._smoothed(track) or track.target

    def _smoothed(self, track: LiveTrack) -> SmoothedTarget | None:
        answer = self.frame.answer(track.id) if track.id > 0 else None
        return None if answer is None else SmoothedTarget(self.frame, track.id, track.target, answer)
