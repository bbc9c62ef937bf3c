"""The carrier's poses at a frame's instants, found once for all users of the frame.

Also for those to come: where a late frame has this one processed again, later telemetry would place the camera
elsewhere, by decimetres in the first second. Each frame keeps the pose that it had at first.
"""

from __future__ import annotations

import numpy as np

from fwav_companion.estimation.errors import CAMERA_DELAY, READOUT, Array, Ints
from fwav_companion.estimation.frame_cache import ReportedMotion
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.measurement import Poses
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.problem import attitude_shift

_ONE_INSTANT_S = 1e-6


class FramePoses:
    """Poses by the shared parameters of a solve, which stay until the next one."""

    def __init__(self, carrier: Carrier, shared: Array) -> None:
        """shared: (S,)."""
        self._carrier, self._shift = carrier, attitude_shift(shared)
        self._delay, self._readout = float(shared[CAMERA_DELAY]), float(shared[READOUT])
        self._pose: tuple[float, Poses] | None = None
        self.answered_t: float | None = None  # s, at which the present frame's answers are asked

    def pose(self, t: float) -> Poses:
        """The pose of a frame stamped t."""
        if self._pose is None or self._pose[0] != t:
            found = self._carrier.frames.get((t, self._delay, self._shift))
            self.hold(t, self._found(t) if found is None else found)
        assert self._pose is not None  # noqa: S101  (it is held now)
        return self._pose[1]

    def _found(self, t: float) -> Poses:
        # One more instant costs little here; the frame's answers need the motion at its own.
        carrier, answered_t = self._carrier.as_in_time(t), t if self.answered_t is None else self.answered_t
        last = min(answered_t, carrier.path.newest)
        instants = np.array([t - self._delay, last])
        path = carrier.path.at(instants)  # (3, 2) each
        unmeasured_m = float(carrier.path.unmeasured_m(np.array([answered_t]))[0])
        motion = ReportedMotion(last, path.position[:, 1], path.velocity[:, 1], unmeasured_m)
        self._carrier.motions.keep(answered_t, motion)
        pose = carrier.live_poses(instants[:1], self._shift, path.first())
        return self._carrier.frames.keep((t, self._delay, self._shift), pose)

    def motion(self, t: float) -> ReportedMotion:
        """The reported motion at t; at the newest sample where t is later."""
        found = self._carrier.motions.get(t)
        if found is None:
            path = self._carrier.as_in_time(t).path
            last = min(t, path.newest)
            position, velocity, _ = path.at(np.array([last]))
            unmeasured_m = float(path.unmeasured_m(np.array([t]))[0])
            motion = ReportedMotion(last, position[:, 0], velocity[:, 0], unmeasured_m)
            found = self._carrier.motions.keep(t, motion)
        return found

    def of(self, s: Sightings, detection: Ints, later_s: float = 0.0) -> Poses:
        """Poses of a frame's detections (M,): one pose, or with a rolling shutter that of each detection's row.

        later_s: delay of the camera beyond the estimated one.
        """
        t = s.t - s.row * self._readout if self._readout else s.t
        if not later_s and (len(t) == 1 or t.max() - t.min() < _ONE_INSTANT_S):
            return self.pose(float(t[0]))
        instants = t - self._delay - later_s
        key = (instants.tobytes(), self._shift)
        found = self._carrier.frames.get(key)
        if found is None:
            carrier = self._carrier.as_in_time(float(s.t[0]))
            found = self._carrier.frames.keep(key, carrier.live_poses(instants, self._shift))
        return found.take(detection)

    def found_together(self, stamps: list[float]) -> list[Poses]:
        """The poses of frames with these stamps, to be held one after the other."""
        carrier, frames = self._carrier.as_in_time(max(stamps)), self._carrier.frames
        poses = carrier.live_poses(np.array(stamps) - self._delay, self._shift)
        keys = [(t, self._delay, self._shift) for t in stamps]
        return [frames.get(key) or frames.keep(key, poses.take(np.array([i]))) for i, key in enumerate(keys)]

    def hold(self, t: float, pose: Poses) -> None:
        """Use this pose for the frame stamped t."""
        self._pose = t, pose
