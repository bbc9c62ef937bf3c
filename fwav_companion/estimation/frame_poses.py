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
_FIRST = np.zeros(1, np.int64)


class FramePoses:
    """Poses by the shared parameters of a solve, which stay until the next one."""

    def __init__(self, carrier: Carrier, shared: Array) -> None:
        """shared: (S,)."""
        self._carrier, self._shift = carrier, attitude_shift(shared)
        self._delay, self._readout = float(shared[CAMERA_DELAY]), float(shared[READOUT])
        self._pose: tuple[float, Poses] | None = None

    def pose(self, t: float) -> Poses:
        """The pose of a frame stamped t."""
        if self._pose is None or self._pose[0] != t:
            found = self._carrier.frames.get((t, self._delay, self._shift))
            self.hold(t, self._found(t) if found is None else found)
        assert self._pose is not None  # noqa: S101  (it is held now)
        return self._pose[1]

    def _found(self, t: float) -> Poses:
        # The stamp's own instant costs nothing more here; the frame's answers need the motion then.
        carrier = self._carrier.as_in_time(t)
        last = min(t, carrier.path.newest)
        both = self._at(np.array([t - self._delay, last]), carrier)
        self._carrier.motions.keep(t, ReportedMotion(last, both.position[:, 1], both.velocity[:, 1]))
        return self._carrier.frames.keep((t, self._delay, self._shift), both.take(_FIRST))

    def motion(self, t: float) -> ReportedMotion:
        """The reported motion at t; at the newest sample where t is later."""
        found = self._carrier.motions.get(t)
        if found is None:
            path = self._carrier.as_in_time(t).path
            last = min(t, path.newest)
            position, velocity, _ = path.at(np.array([last]))
            found = self._carrier.motions.keep(t, ReportedMotion(last, position[:, 0], velocity[:, 0]))
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
            found = self._carrier.frames.keep(key, self._at(instants, self._carrier.as_in_time(float(s.t[0]))))
        return found.take(detection)

    def found_together(self, stamps: list[float]) -> list[Poses]:
        """The poses of frames with these stamps, to be held one after the other."""
        carrier, frames = self._carrier.as_in_time(max(stamps)), self._carrier.frames
        poses = self._at(np.array(stamps) - self._delay, carrier)
        keys = [(t, self._delay, self._shift) for t in stamps]
        return [frames.get(key) or frames.keep(key, poses.take(np.array([i]))) for i, key in enumerate(keys)]

    def hold(self, t: float, pose: Poses) -> None:
        """Use this pose for the frame stamped t."""
        self._pose = t, pose

    def _at(self, t: Array, carrier: Carrier) -> Poses:
        """Poses at instants (N,) of the carrier's own time."""
        return carrier.poses(t, carrier.live_rates(t, self._shift), self._shift)
