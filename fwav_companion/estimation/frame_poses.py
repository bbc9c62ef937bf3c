"""The carrier's poses at a frame's instants, found once for all users of the frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.errors import CAMERA_DELAY, READOUT, Array, Ints
from fwav_companion.estimation.kept_sightings import Sightings
from fwav_companion.estimation.measurement import Poses
from fwav_companion.estimation.path_samples import Carrier
from fwav_companion.estimation.problem import attitude_shift

_ONE_INSTANT_S = 1e-6
_FIRST = np.zeros(1, np.int64)


class ReportedMotion(NamedTuple):
    """The camera's reported motion at an instant."""

    t: float  # s
    position: Array  # (3,) m north, east, height
    velocity: Array  # (3,) m/s

    def at(self, t: float) -> Array:
        """Position (3,) at a later instant, carried on by the velocity."""
        return self.position + self.velocity * (t - self.t)


class FramePoses:
    """Poses by the shared parameters of a solve, which stay until the next one."""

    def __init__(self, carrier: Carrier, shared: Array) -> None:
        """shared: (S,)."""
        self._carrier, self._shift = carrier, attitude_shift(shared)
        self._delay, self._readout = float(shared[CAMERA_DELAY]), float(shared[READOUT])
        self._pose: tuple[float, Poses] | None = None
        self._motion: tuple[float, ReportedMotion] | None = None

    def pose(self, t: float) -> Poses:
        """The pose of a frame stamped t."""
        if self._pose is None or self._pose[0] != t:
            # The stamp's own instant costs nothing more here; the frame's answers need the motion then.
            last = min(t, self._carrier.path.newest)
            both = self._at(np.array([t - self._delay, last]))
            self._pose = t, both.take(_FIRST)
            self._motion = t, ReportedMotion(last, both.position[:, 1], both.velocity[:, 1])
        return self._pose[1]

    def motion(self, t: float) -> ReportedMotion:
        """The reported motion at t; at the newest sample where t is later."""
        if self._motion is None or self._motion[0] != t:
            last = min(t, self._carrier.path.newest)
            position, velocity, _ = self._carrier.path.at(np.array([last]))
            self._motion = t, ReportedMotion(last, position[:, 0], velocity[:, 0])
        return self._motion[1]

    def of(self, s: Sightings, detection: Ints, later_s: float = 0.0) -> Poses:
        """Poses of a frame's detections (M,): one pose, or with a rolling shutter that of each detection's row.

        later_s: delay of the camera beyond the estimated one.
        """
        t = s.t - s.row * self._readout if self._readout else s.t
        if not later_s and (len(t) == 1 or t.max() - t.min() < _ONE_INSTANT_S):
            return self.pose(float(t[0]))
        return self._at(t - self._delay - later_s).take(detection)

    def found_together(self, stamps: list[float]) -> list[Poses]:
        """The poses of frames with these stamps, to be held one after the other."""
        poses = self._at(np.array(stamps) - self._delay)
        return [poses.take(np.array([i])) for i in range(len(stamps))]

    def hold(self, t: float, pose: Poses) -> None:
        """Use this pose for the frame stamped t."""
        self._pose = t, pose

    def _at(self, t: Array) -> Poses:
        """Poses at instants (N,) of the carrier's own time."""
        return self._carrier.poses(t, self._carrier.live_rates(t, self._shift), self._shift)
