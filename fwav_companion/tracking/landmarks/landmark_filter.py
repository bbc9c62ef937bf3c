"""Filter of the errors that all targets share, by sights of landmarks.

A sight is a direction to a known place: measured minus known direction is ``H s + noise`` with the shared errors s
(``state_vector``, ``ray_measurement``). The survey error of each landmark is among them, so that many sights do not
average it away. A landmark that all else contradicts is left out: its prior is removed, which is exact for a linear
filter and undoes its earlier corrections.

Immutable. A frame gives the next state twice: at its instant, and after its sights. Each state has the steps that are
to be applied to the places of the targets.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Self

import msgspec
import numpy as np
from msgspec.structs import replace

from fwav_companion.geometry.stamps import NS_PER_S, HostNs, s_from_ns
from fwav_companion.geometry.vectors import ZERO3
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.delayed_poses import StateAt
from fwav_companion.tracking.filters.standing import FRESH_SHARE
from fwav_companion.tracking.landmarks.delayed_sighting import DelayedSighting, PoseHistory
from fwav_companion.tracking.landmarks.joint_place import Correction, Transition, stepped
from fwav_companion.tracking.landmarks.landmark_estimate import IN_A_ROW, LandmarkEstimate, Sequel
from fwav_companion.tracking.landmarks.landmark_examination import examined
from fwav_companion.tracking.landmarks.ray_measurement import CameraPath, first_path, ray_measurement
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.types import FrameView, LandmarkRecord, LandmarkSight, LandmarkState, Sighting

GATE = 25.0
"""Gate on the normalised innovation squared of a sight, 2 degrees of freedom: a true one exceeds it once in 300 000."""
ITERATIONS = 3
"""Number of updates by a first sight, each linearized at the estimate of the update before."""
EXAMINED_EVERY_NS = NS_PER_S
FIRST_S = 1e9
"""Interval before a first sight, seconds: that sight repeats no telemetry."""


class PreparedSight(msgspec.Struct, frozen=True, gc=False):
    """A sight, prepared as a measurement."""

    sequel: Sequel
    correction: Correction
    nis: float
    """Normalised innovation squared, two degrees of freedom."""
    off_m: float
    """Distance from the expected place, metres."""


class LandmarkFilter(LandmarkEstimate, frozen=True):
    """Estimate of the shared errors, predicted to frames and updated by sights."""

    path: CameraPath | None = None
    """The camera's path; None before the first sight of anything."""
    host_ns: HostNs | None = None
    examined_ns: HostNs = HostNs(0)
    history: PoseHistory = PoseHistory()

    @classmethod
    def start(cls, model: SharedErrors, state_at: StateAt | None = None) -> Self:
        """The state before the first frame."""
        return cls(
            model=model,
            mean=np.zeros(model.size),
            cov=model.prior(model.position_sigma_m),
            sigma_m=model.position_sigma_m,
            records=tuple(LandmarkRecord(landmark.label) for landmark in model.landmarks),
            history=PoseHistory(state_at),
            sequels=(None,) * len(model.landmarks),
        )

    def predicted(self, view: FrameView) -> Self:
        """The state predicted to the instant of a frame."""
        state = replace(self, steps=())
        fixes = (*view.fixes, *(sight.fix for sight in view.landmarks))
        if fixes:
            sighting = fixes[0].sighting
            path = first_path(sighting) if self.path is None else self.path.after(sighting)
            history = self.history.after(sighting, self.model.attitude_noise)
            wander = self.model.own.model.wander_at(fixes[0])
            state = replace(state._by_receiver(wander.sigma_m), path=path, history=history)
        if self.host_ns is None or view.host_ns <= self.host_ns:
            return replace(state, host_ns=self.host_ns or view.host_ns)
        state = state._later(view.host_ns)
        return state.position_jumped(view.jumped_m**2) if view.jumped_m else state

    def seen(self, sights: Sequence[LandmarkSight]) -> Self:
        """The state after the sights of this instant, at most one of each landmark."""
        state = replace(self, steps=())
        for sight in sights:
            if state.records[sight.landmark].state is not LandmarkState.LEFT_OUT:
                state = state._with_sight(sight)
        now_ns = self.host_ns or HostNs(0)
        if sights and now_ns - state.examined_ns >= EXAMINED_EVERY_NS:
            state = replace(examined(state), examined_ns=now_ns)
        return state

    def position_jumped(self, variance: float) -> Self:
        """The state after a jump of the vehicle's position. ``variance``: of the jump, m^2 an axis."""
        first, last = self.model.wander.start, self.model.wander.stop
        noise = np.zeros_like(self.cov)
        errors = np.arange(first, last, 2)
        noise[errors, errors] = variance / ((last - first) // 4) if first < last else 0.0
        return replace(self.after(Transition(np.eye(self.model.size), noise)), path=None)

    # Time.

    def _later(self, host_ns: HostNs) -> Self:
        model, wander = self.model, self.model.wander
        step = model.transition(self.host_ns or host_ns, host_ns)
        matrix, noise = np.eye(model.size), np.zeros_like(self.cov)
        matrix[wander, wander] = step
        stationary = np.diag(model.stationary(self.sigma_m))
        noise[wander, wander] = stationary - step @ stationary @ step.T
        return replace(self.after(Transition(matrix, noise)), host_ns=host_ns)

    def _by_receiver(self, sigma_m: float) -> Self:
        """The state for a receiver of another accuracy: a better receiver has new errors, those of a worse one grow."""
        if sigma_m == self.sigma_m:
            return self
        if not sigma_m <= FRESH_SHARE * self.sigma_m and self.host_ns is not None:
            return replace(self, sigma_m=sigma_m)
        keep = np.ones(self.model.size)
        keep[self.model.altitude : self.model.wander.stop] = 0.0
        prior = np.diag((1.0 - keep) * np.diag(self.model.prior(sigma_m)))
        return replace(self.after(Transition(np.diag(keep), prior)), sigma_m=sigma_m)

    # Sights.

    def _with_sight(self, sight: LandmarkSight) -> Self:
        landmark, prepared = sight.landmark, self._prepared(sight, self.mean)
        if self.records[landmark].used < IN_A_ROW:
            prepared = self._iterated(sight, prepared)
        sequel, correction, record = prepared.sequel, prepared.correction, self.records[landmark]
        if prepared.nis <= GATE:
            after = replace(record, state=LandmarkState.USED, used=record.used + 1)
            return self.after(correction).recorded(landmark, after, replace(sequel, in_a_row=0))
        off_m = prepared.off_m
        record = replace(record, refused=record.refused + 1, off_m=off_m)
        if sequel.in_a_row + 1 < IN_A_ROW:
            return self.recorded(landmark, record, replace(sequel, in_a_row=sequel.in_a_row + 1))
        state = self.recorded(landmark, record, replace(sequel, in_a_row=0))
        if record.used >= IN_A_ROW:  # a landmark that agreed has not moved: the vehicle's position has
            return state.position_jumped(off_m**2).recorded(landmark, replace(record, used=0))
        used = replace(record, state=LandmarkState.USED)
        with_it = examined(state.after(correction).recorded(landmark, used, sequel), at_once=True)
        decided = any(
            now.state is not before.state
            for now, before in zip(with_it.records, state.records, strict=True)
            if before.state is LandmarkState.USED or now.state is LandmarkState.LEFT_OUT
        )
        return with_it if decided else state

    def _iterated(self, sight: LandmarkSight, first: PreparedSight) -> PreparedSight:
        """The sight linearized at the estimate that it leads to (iterated Kalman filter: Bell & Cathey 1993).

        The first sights move the estimate by a metre or two. Linearized at the estimate before them, their
        sensitivities to the altitude differ from those of later sights by a tenth. The filter takes the difference for
        information: over descents it claimed the altitude to 0.9 m after a second, where 1.5 m is possible.
        """
        prepared = first
        for _ in range(ITERATIONS):
            mean, _ = stepped(self.shared, prepared.correction, self.model.estimated)
            prepared = self._prepared(sight, mean)
        return replace(prepared, nis=first.nis, off_m=first.off_m)

    def _prepared(self, sight: LandmarkSight, mean: Array) -> PreparedSight:
        """The sight against the known place. Rows for altitude and survey complete those of ``ray_measurement``."""
        model, fix, before = self.model, sight.fix, self.sequels[sight.landmark]
        host_ns, survey = fix.sighting.frame_host_ns, model.survey(sight.landmark)
        since_s = FIRST_S if before is None else max(s_from_ns(host_ns - before.at_ns), 1e-3)
        north, east, up = map(float, mean[survey])
        measurement = ray_measurement(
            model,
            fix,
            mean,
            pose=self.pose(fix.sighting),
            point=(sight.north_m + north, sight.east_m + east, fix.position_ned[2] - up),
            too_high_m=float(mean[model.altitude]),
            shift=ZERO3 if self.path is None else self.path.shift,
            since_s=since_s,
        )
        rows, by_point = measurement.rows, measurement.by_point
        rows[:, model.altitude] = -by_point[:, 2]
        rows[:, survey] = by_point * (1.0, 1.0, -1.0)
        innovation = measurement.innovation
        nis = float(innovation @ np.linalg.solve(rows @ self.cov @ rows.T + measurement.noise, innovation))
        off_m = hypot(*map(float, np.linalg.lstsq(by_point[:, :2], innovation, rcond=None)[0]))
        sequel = Sequel(host_ns, 0 if before is None else before.in_a_row)
        return PreparedSight(sequel, measurement.correction(rows, mean), nis, off_m)

    def pose(self, sighting: Sighting) -> DelayedSighting:
        """The sighting with the pose at the estimated delay."""
        return self.history.delayed(sighting, self.model.late_s(sighting, self.mean))
