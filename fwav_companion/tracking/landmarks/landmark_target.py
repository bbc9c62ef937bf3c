"""A static target whose place is corrected by the errors that landmarks show."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Self

import numpy as np
from msgspec.structs import asdict, replace

from fwav_companion.geometry.small_matrices import Symmetric2, horizontal_sigma
from fwav_companion.geometry.stamps import s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.filters.consider_biases import FIRST_SENSITIVITY_S, Measurement
from fwav_companion.tracking.filters.kalman import StaticTargetState
from fwav_companion.tracking.filters.linearization import is_level
from fwav_companion.tracking.landmarks.joint_place import Correction, JointPlace, unknown_place
from fwav_companion.tracking.landmarks.landmark_examination import release
from fwav_companion.tracking.landmarks.landmark_filter import ITERATIONS, LandmarkFilter
from fwav_companion.tracking.landmarks.ray_measurement import ray_measurement
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.types import (
    Bias,
    GroundFix,
    LandmarkSight,
)


class LandmarkTargetState(StaticTargetState, frozen=True, kw_only=True, gc=False):
    """One static target, estimated by its own filter and by a joint place that landmarks correct."""

    joint: JointPlace
    landmarks: LandmarkFilter
    """State of the landmark filter at the newest frame."""
    separation: Symmetric2 = (0.0, 0.0, 0.0)
    """Squared movement of the place without each suspect, summed over the suspects, m^2."""

    @property
    def position_ned(self) -> Vector3:
        """Place, NED, metres."""
        if not self._is_better:
            return super().position_ned
        return (float(self.joint.place[0]), float(self.joint.place[1]), self.down.down_m)

    @property
    def cov(self) -> Matrix3:
        """Covariance of the place by every source of error, NED, m^2."""
        return self._joint_cov if self._is_better else super().cov

    @property
    def _joint_cov(self) -> Matrix3:
        (nn, ne, ee), (s_nn, s_ne, s_ee) = self.joint.horizontal, self.separation
        nn, ne, ee = nn + s_nn, ne + s_ne, ee + s_ee
        return ((nn, ne, 0.0), (ne, ee, 0.0), (0.0, 0.0, super().cov[2][2]))

    @property
    def _is_better(self) -> bool:
        """Whether landmarks are used and the joint place has the smaller sigma. Both sigmas include every error."""
        return self.landmarks.shows and horizontal_sigma(self._joint_cov) < horizontal_sigma(super().cov)

    def bias_shares(self) -> dict[Bias, float]:
        """Horizontal variance of the place by each bias, m^2; empty where landmarks correct it."""
        return {} if self._is_better else super().bias_shares()

    def after(self, landmarks: LandmarkFilter) -> Self:
        """The state after the newest steps of the landmark filter."""
        joint = self.joint
        for step in landmarks.steps:
            joint = joint.after(step)
        separation = self.separation
        if landmarks.examined_ns != self.landmarks.examined_ns:
            separation = _separation(joint, landmarks)
        return replace(self, joint=joint, landmarks=landmarks, separation=separation)

    def update(self, fix: GroundFix) -> Self:
        """The state after a fix of this instant."""
        since_s = max(s_from_ns(fix.sighting.frame_host_ns - self.fixed_ns), 1e-3)
        if is_level(fix):
            measured = self._by_direction(fix, self.joint.mean, since_s)
        else:
            measured = _on_the_ground(self.measured(fix), fix, self.landmarks.model)
        return replace(super().update(fix), joint=self.joint.update(measured))

    def by_first(self, fix: GroundFix) -> Self:
        """The state with a place by its first fix, on level ground linearized at the estimate that the fix leads to."""
        joint, errors = self.joint, self.landmarks.model.errors
        if is_level(fix):
            for _ in range(ITERATIONS):
                joint = self.joint.update(self._by_direction(fix, joint.mean, FIRST_SENSITIVITY_S))
        else:
            measurement = errors.at_own_ray(errors.prepared(fix), fix, FIRST_SENSITIVITY_S)
            joint = joint.update(_on_the_ground(measurement, fix, self.landmarks.model))
        return replace(self, joint=joint, separation=_separation(joint, self.landmarks))

    def _by_direction(self, fix: GroundFix, mean: Array, since_s: float) -> Correction:
        """A fix on level ground as a measurement of the direction to the place, linearized at ``mean``."""
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


class LandmarkTracking(LandmarkFilter, frozen=True):
    """The landmarks, and the targets that they correct."""

    def tracked(self, sights: Sequence[LandmarkSight], fixes: Iterable[GroundFix]) -> LandmarkTracking:
        """The landmarks after the sights of this frame. ``fixes``: of confirmed tracks. Other sights are clutter."""
        seen = {fix.sighting.index for fix in fixes}
        taken = {sight.landmark: sight for sight in sights if sight.fix.sighting.index in seen}
        return self.seen(list(taken.values()))

    def corrected(self, target: TargetState) -> TargetState:
        """A target after the newest steps of the landmarks."""
        return target.after(self) if isinstance(target, LandmarkTargetState) else target

    def initiate(self, fix: GroundFix) -> LandmarkTargetState:
        """The state after the first fix of a target, in this frame."""
        own = asdict(self.model.own.initiate(fix))
        joint = unknown_place(fix.position_ned, self.shared, self.model.estimated)
        return LandmarkTargetState(**own, joint=joint, landmarks=self).by_first(fix)

    def restarted(self) -> LandmarkTracking:
        """The landmarks after every target was dropped, because the vehicle or its world is another one."""
        return self.start(self.model, self.history.state_at)


def _separation(joint: JointPlace, landmarks: LandmarkFilter) -> Symmetric2:
    """Squared movement of the place without each suspect, summed over the suspects, m^2."""
    total = np.zeros((2, 2))
    for landmark in landmarks.suspects:
        moved = joint.after(release(landmarks.model, landmark)).place - joint.place
        total += np.outer(moved, moved)
    return float(total[0, 0]), float(total[0, 1]), float(total[1, 1])


def _on_the_ground(measurement: Measurement, fix: GroundFix, model: SharedErrors) -> Correction:
    """A fix as a horizontal measurement of the place and of the shared errors."""
    rows = np.hstack((np.eye(2), model.rows(measurement, fix)))
    return Correction(np.array(measurement.position[:2]), rows, np.array(measurement.noise)[:2, :2])
