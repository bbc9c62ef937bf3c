"""A standing target with the errors that landmarks show taken out of its place."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Self

import msgspec
import numpy as np
from msgspec.structs import replace

from fwav_companion.geometry.small_matrices import Symmetric2, horizontal_sigma
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.delayed_poses import StateAt
from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.filters.consider_biases import FIRST_SENSITIVITY_S, Measurement
from fwav_companion.tracking.filters.kalman import StaticKalman, StaticTargetState
from fwav_companion.tracking.filters.linearization import is_level
from fwav_companion.tracking.landmarks.joint_place import Correction, JointPlace, first_joint_place, unknown_place
from fwav_companion.tracking.landmarks.landmark_examination import release
from fwav_companion.tracking.landmarks.landmark_filter import ITERATIONS, LandmarkFilter, landmark_filter
from fwav_companion.tracking.landmarks.ray_measurement import ray_measurement
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.types import (
    Bias,
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
    separation: Symmetric2 = (0.0, 0.0, 0.0)
    """What the place moves without each suspect, squared, m^2."""

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
        (nn, ne, ee), (s_nn, s_ne, s_ee) = self.joint.horizontal, self.separation
        nn, ne, ee = nn + s_nn, ne + s_ne, ee + s_ee
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
        separation = self.separation
        if landmarks.examined_ns != self.landmarks.examined_ns:
            separation = _separation(joint, landmarks)
        return replace(self, joint=joint, landmarks=landmarks, separation=separation)

    def gate(self, fix: GroundFix) -> GateResult:
        """Gating statistics of a fix at this instant."""
        return self.own.gate(fix)

    def gates(self, fixes: Sequence[GroundFix]) -> list[GateResult]:
        """Gating statistics of several fixes."""
        return self.own.gates(fixes)

    def update(self, fix: GroundFix) -> Self:
        """The state after a fix of this instant."""
        joint, since_s = self.joint, max(s_from_ns(fix.sighting.frame_host_ns - self.own.fixed_ns), 1e-3)
        if is_level(fix):
            joint = joint.update(self._by_direction(fix, joint.mean, since_s))
        else:
            joint = joint.update(_on_the_ground(self.own.measured(fix), fix, self.landmarks.model))
        return replace(self, own=self.own.update(fix), joint=joint)

    def by_first_direction(self, fix: GroundFix) -> Self:
        """The state after its first fix on level ground, about the estimate that the fix leads to."""
        unknown, joint = unknown_place(self.joint, self.landmarks.shared), self.joint
        for _ in range(ITERATIONS):
            joint = unknown.update(self._by_direction(fix, joint.mean, FIRST_SENSITIVITY_S))
        return replace(self, joint=joint)

    def _by_direction(self, fix: GroundFix, mean: Array, since_s: float) -> Correction:
        """A fix on level ground as a measurement of direction to the place, linear about ``mean``."""
        model, path = self.landmarks.model, self.landmarks.path
        sighting = fix.sighting
        down_m = fix.position_ned[2] - sighting.anchor_height_m
        too_deep_m = model.value(mean[2:], Bias.TERRAIN) if any(fix.bias_jacobian[Bias.TERRAIN]) else 0.0
        too_deep_m += sighting.anchor_sigma_m * model.value(mean[2:], Bias.TARGET_HEIGHT)
        measurement = ray_measurement(
            model,
            fix,
            mean[2:],
            pose=self.landmarks.pose(sighting),
            point=(float(mean[0]), float(mean[1]), down_m + too_deep_m),
            too_high_m=0.0,
            shift=ZERO3 if path is None else path.shift,
            since_s=since_s,
        )
        model.with_level(measurement.rows, fix, measurement.by_point)
        return measurement.correction(np.hstack((measurement.by_point[:, :2], measurement.rows)), mean)


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
        fixed = _on_the_ground(measurement, fix, landmarks.model)
        joint = first_joint_place(fixed, landmarks.shared, landmarks.model.estimated)
        target = LandmarkTargetState(own=own, joint=joint, landmarks=landmarks)
        target = target.by_first_direction(fix) if is_level(fix) else target
        return replace(target, separation=_separation(target.joint, landmarks))

    def restarted(self) -> LandmarkTracking:
        """The landmarks after every target was dropped: the vehicle or its world is another one."""
        return LandmarkTracking(self.own, landmark_filter(self.landmarks.model, self.landmarks.history.state_at))


def landmark_tracking(
    priors: ErrorPriors, landmarks: Sequence[Landmark], state_at: StateAt | None = None
) -> LandmarkTracking:
    """The start of a flight with landmarks."""
    return LandmarkTracking(StaticKalman(priors), landmark_filter(SharedErrors(priors, landmarks), state_at))


def _separation(joint: JointPlace, landmarks: LandmarkFilter) -> Symmetric2:
    """The sum over all suspects of the square of what the place moves without them, m^2."""
    total = np.zeros((2, 2))
    for landmark in landmarks.suspects:
        moved = joint.after(release(landmarks.model, landmark)).place - joint.place
        total += np.outer(moved, moved)
    return float(total[0, 0]), float(total[0, 1]), float(total[1, 1])


def _on_the_ground(measurement: Measurement, fix: GroundFix, model: SharedErrors) -> Correction:
    """A fix, horizontal, as a measurement of the place and of the shared errors."""
    rows = np.hstack((np.eye(2), model.rows(measurement, fix)))
    return Correction(np.array(measurement.position[:2]), rows, np.array(measurement.noise)[:2, :2])
