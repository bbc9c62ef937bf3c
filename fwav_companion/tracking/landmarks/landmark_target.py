"""A standing target with the errors that landmarks show taken out of its place."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Self

import msgspec
import numpy as np
from msgspec.structs import replace

from fwav_companion.geometry.small_matrices import horizontal_sigma
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, scale
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.filters.consider_biases import FIRST_SENSITIVITY_S, Measurement
from fwav_companion.tracking.filters.kalman import StaticKalman, StaticTargetState
from fwav_companion.tracking.landmarks.joint_place import JointPlace, first_joint_place
from fwav_companion.tracking.landmarks.landmark_filter import LandmarkFilter, landmark_filter
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.tracking.landmarks.turned_fix import rotation_error, turned_point
from fwav_companion.types import (
    ErrorPriors,
    FrameView,
    GroundFix,
    Landmark,
    LandmarkAltitude,
    LandmarkRecord,
    LandmarkSight,
)
from fwav_companion.types.tracks import GateResult, GateShare


class LandmarkTargetState(msgspec.Struct, frozen=True, kw_only=True):
    """One standing target: by its own filter, and by a place that landmarks correct."""

    own: StaticTargetState
    joint: JointPlace
    landmarks: LandmarkFilter
    """The landmarks at the newest frame."""

    @property
    def position_ned(self) -> Vector3:
        """Place, NED, metres."""
        if not self._is_better:
            return self.own.position_ned
        return (float(self.joint.place[0]), float(self.joint.place[1]), self.own.position_ned[2])

    @property
    def cov(self) -> Matrix3:
        """Covariance of the place by every source of error, NED, m^2."""
        if not self._is_better:
            return self.own.cov
        return self._joint_cov

    @property
    def _joint_cov(self) -> Matrix3:
        nn, ne, ee = self.joint.horizontal
        return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, self.own.cov[2][2]))

    @property
    def _is_better(self) -> bool:
        """Whether landmarks were seen, and show more than the own filter claims. Both claims hold every error."""
        return self.landmarks.shows and horizontal_sigma(self._joint_cov) < horizontal_sigma(self.own.cov)

    @property
    def apparent_ned(self) -> Vector3:
        """Place plus the present error of the vehicle's position, NED, metres."""
        return self.own.apparent_ned

    @property
    def relative_cov(self) -> Matrix3:
        """Covariance of the target relative to the vehicle, NED, m^2."""
        return self.own.relative_cov

    @property
    def velocity_ned(self) -> Vector3 | None:
        """None: a standing target has no velocity."""
        return None

    @property
    def velocity_cov(self) -> Matrix3 | None:
        """None: a standing target has no velocity."""
        return None

    @property
    def gate_share(self) -> GateShare:
        """The share of this target in the gate's variance."""
        return self.own.gate_share

    def gate_share_of(self, fix: GroundFix) -> GateShare:
        """The share of a fix."""
        return self.own.gate_share_of(fix)

    def predict(self, host_ns: HostNs) -> Self:
        """The state at a later instant; :meth:`after` takes the landmarks' steps."""
        return replace(self, own=self.own.predict(host_ns))

    def jumped(self, jump_m: float) -> Self:
        """The state after a jump of the vehicle's position; the landmarks take it themselves."""
        return replace(self, own=self.own.jumped(jump_m))

    def after(self, landmarks: LandmarkFilter) -> Self:
        """The state after the landmarks of a frame."""
        joint = self.joint
        for step in landmarks.steps:
            joint = joint.after(step)
        return replace(self, joint=joint, landmarks=landmarks)

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix at this instant."""
        return self.own.gate(fix)

    def gates(self, fixes: Sequence[GroundFix]) -> list[GateResult]:
        """Gating statistics of several fixes."""
        return self.own.gates(fixes)

    def update(self, fix: GroundFix) -> Self:
        """The state after a fix of this instant."""
        position, noise, rows = _linearized(self.own.measured(fix), fix, self.landmarks)
        joint = self.joint.update(position, noise, rows, self.landmarks.shared)
        return replace(self, own=self.own.update(fix), joint=joint)


class LandmarkTracking(msgspec.Struct, frozen=True):
    """What the tracker asks of landmarks. Immutable: a frame gives the next."""

    own: StaticKalman
    landmarks: LandmarkFilter

    @property
    def records(self) -> tuple[LandmarkRecord, ...]:
        """What each landmark showed so far."""
        return self.landmarks.records

    @property
    def shows(self) -> bool:
        """Whether any landmark was seen and is used."""
        return self.landmarks.shows

    @property
    def altitude(self) -> LandmarkAltitude | None:
        """The vehicle's altitude against a landmark; None before one was seen often enough."""
        return self.landmarks.altitude

    def predicted(self, view: FrameView) -> LandmarkTracking:
        """The landmarks at the instant of a frame."""
        return LandmarkTracking(self.own, self.landmarks.predicted(view))

    def seen(self, sights: Sequence[LandmarkSight], fixes: Iterable[GroundFix]) -> LandmarkTracking:
        """The landmarks after the sights of this frame. ``fixes``: of confirmed tracks; other sights are clutter."""
        tracked = {fix.sighting.index for fix in fixes}
        taken = {sight.landmark: sight for sight in sights if sight.fix.sighting.index in tracked}
        return LandmarkTracking(self.own, self.landmarks.seen(list(taken.values())))

    def corrected(self, target: TargetState) -> TargetState:
        """A target with the landmarks' newest steps."""
        return target.after(self.landmarks) if isinstance(target, LandmarkTargetState) else target

    def initiate(self, fix: GroundFix) -> LandmarkTargetState:
        """The state after the first fix of a target, in this frame."""
        own, landmarks = self.own.initiate(fix), self.landmarks
        errors = landmarks.model.errors
        measurement = errors.with_sensitivity_noise(errors.prepared(fix), FIRST_SENSITIVITY_S)
        position, noise, rows = _linearized(measurement, fix, landmarks)
        joint = first_joint_place(position, noise, rows, landmarks.shared)
        return LandmarkTargetState(own=own, joint=joint, landmarks=landmarks)

    def restarted(self) -> LandmarkTracking:
        """The landmarks after every target was dropped: the vehicle or its world is another one."""
        return LandmarkTracking(self.own, landmark_filter(self.landmarks.model))


def landmark_tracking(priors: ErrorPriors, landmarks: Sequence[Landmark]) -> LandmarkTracking:
    """The start of a flight with landmarks."""
    return LandmarkTracking(StaticKalman(priors), landmark_filter(SharedErrors(priors, landmarks)))


def _linearized(measurement: Measurement, fix: GroundFix, landmarks: LandmarkFilter) -> tuple[Array, Array, Array]:
    """Position, noise and rows of a fix, horizontal, about what the landmarks show of the shared errors.

    The position is such that position minus rows times mean is the fix with the rotations taken out exactly.
    """
    model, mean = landmarks.model, landmarks.mean
    turn, height_m = rotation_error(model, fix, mean), fix.position_ned[2] - fix.sighting.camera_ned[2]
    rows = model.rows(measurement, fix)
    there, back = turned_point(fix, turn, height_m), turned_point(fix, scale(turn, -1.0), height_m)
    bend = 0.5 * (np.array(there) + np.array(back)) - np.array(turned_point(fix, ZERO3, height_m))
    return np.array(measurement.position[:2]) + bend, np.array(measurement.noise)[:2, :2], rows
