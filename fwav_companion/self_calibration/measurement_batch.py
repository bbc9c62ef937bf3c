"""Sightings of one frame or of a few as arrays: the rays, the poses of the vehicle, and the noise of each.

A batch holds everything that a prediction of pixels needs. Each entry depends on its own sighting alone.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import msgspec
import numpy as np
import numpy.typing as npt

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.self_calibration.arrays import Array, Mask, dot, turned, turned_back
from fwav_companion.self_calibration.delayed_poses import DelayedPoses, concatenated
from fwav_companion.self_calibration.position_path import PositionPath
from fwav_companion.types import GroundFix

RANGED = ("rangefinder", "fixed")
"""Ground models that give a distance below the camera, whatever its reported height."""


class MeasurementBatch(msgspec.Struct, frozen=True):
    """N sightings of one frame or of a few, in the order of their capture and of their tracks."""

    tracks: tuple[int, ...]
    host_ns: int
    """Capture of the newest frame."""
    frames: int
    ray: Array
    """(N, 3), unit rays in body axes, by the configured mount."""
    dual: Array
    """(N, 2, 3), same axes, dual to the lens's derivatives: dual . (change of the ray) is the change of u and v."""
    pixel_sigma: Array
    """(N, 2), one sigma of u and v, px."""
    lever: Array
    """(N, 3), camera position in body axes, m."""
    attitude_sigma: Array
    """(N), one sigma of the attitude by interpolation, rad."""
    attitude_spacing_s: Array
    """(N), interval of the attitudes that were interpolated, s."""
    time_noise_s: Array
    """(N), one sigma of the capture, s."""
    row_fraction: Array
    """(N), position of the row in the readout."""
    drop_m: Array
    """(N), height of the camera above the target's ground, as reported."""
    camera_down: Array
    """(N), down coordinate of the camera at the nominal capture, m."""
    since_s: Array
    """(N), time since the track's previous measurement, s; measurements that share telemetry share its noise."""
    frame: npt.NDArray[np.intp]
    """(N), number of the frame: its measurements share one sample of telemetry."""
    ranged: Mask
    """(N), whether the ground model gives a distance below the camera, whatever its reported height."""
    sample: npt.NDArray[np.intp]
    """(N), index of the measurement's point in ``paths``."""
    poses: DelayedPoses
    """(N, D), poses of the vehicle at D delays."""
    paths: tuple[PositionPath, ...] = ()
    """Points of the smoothed path on which the positions lie; empty where positions are as reported."""

    def take(self, index: Sequence[int]) -> MeasurementBatch:
        """The batch with some of the measurements."""
        i = list(index)
        arrays = {name: getattr(self, name)[i] for name in ARRAYS}
        tracks = tuple(self.tracks[k] for k in i)
        return msgspec.structs.replace(self, tracks=tracks, poses=self.poses.each(lambda a: a[i]), **arrays)

    def without(self, tracks: Collection[int]) -> MeasurementBatch:
        """The batch without the measurements of these tracks."""
        if not any(track in tracks for track in self.tracks):
            return self
        return self.take([k for k, track in enumerate(self.tracks) if track not in tracks])

    def nearest_to(self, delay_s: float | None) -> MeasurementBatch:
        """The batch with the poses nearest to a known delay alone; with all poses if the delay is None."""
        if delay_s is None or self.poses.delay_s.shape[1] == 1:
            return self
        return msgspec.structs.replace(self, poses=self.poses.nearest(delay_s).each(lambda a: a[:, None]))

    def at_delay(self, delay_s: float) -> MeasurementBatch:
        """The batch with poses at one delay instead of a grid."""
        poses = self.poses.at(np.full(len(self.tracks), delay_s))
        return msgspec.structs.replace(self, poses=poses.each(lambda a: a[:, None]))


SCALARS = ("attitude_sigma", "attitude_spacing_s", "time_noise_s", "row_fraction", "drop_m", "camera_down", "since_s")
ARRAYS = ("ray", "dual", "pixel_sigma", "lever", *SCALARS, "frame", "ranged", "sample")


def joined(batches: Sequence[MeasurementBatch]) -> MeasurementBatch:
    """All measurements of several batches, at the instant of the last."""
    if len(batches) == 1:
        return batches[0]
    arrays = {name: np.concatenate([getattr(b, name) for b in batches]) for name in ARRAYS}
    return msgspec.structs.replace(
        batches[-1],
        tracks=tuple(track for b in batches for track in b.tracks),
        frames=sum(b.frames for b in batches),
        poses=concatenated([b.poses for b in batches]),
        **arrays,
    )


def measurement_batch(
    fixes: Sequence[tuple[int, GroundFix]], poses: DelayedPoses, since_s: Sequence[float]
) -> MeasurementBatch:
    """The measurements of fixes by track, with their poses (N, D)."""
    sightings = [fix.sighting for _, fix in fixes]
    states = [sighting.state for sighting in sightings]
    mount = np.array([sighting.body_from_camera for sighting in sightings])
    rays = np.array([(s.ray.direction, s.ray.d_du, s.ray.d_dv) for s in sightings])
    a, b = rays[:, 1], rays[:, 2]
    aa, ab, bb = dot(a, a)[:, None], dot(a, b)[:, None], dot(b, b)[:, None]
    dual = np.stack((a * bb - b * ab, b * aa - a * ab), 1) / (aa * bb - ab * ab)[:, :, None]
    arm = np.array([s.camera_ned for s in sightings]) - np.array([st.position_ned or (0.0, 0.0, 0.0) for st in states])
    ned_from_body = np.array([matrix_from_quaternion(state.ned_from_carrier) for state in states])
    scalars = [
        (state.carrier_sigma, state.spacing_s, s.time_noise_s, s.row_fraction,
         fix.height_above_target_m, s.camera_ned[2], since)
        for (_, fix), s, state, since in zip(fixes, sightings, states, since_s, strict=True)
    ]  # fmt: skip
    return MeasurementBatch(
        tracks=tuple(track for track, _ in fixes),
        host_ns=sightings[-1].frame_host_ns,
        frames=len({sighting.frame_host_ns for sighting in sightings}),
        ray=turned(mount, rays[:, 0]),
        dual=turned(mount[:, None], dual),
        pixel_sigma=np.array([s.pixel_sigma for s in sightings]),
        lever=turned_back(ned_from_body, arm),
        frame=np.array([s.frame for s in sightings]),
        ranged=np.array([fix.ground in RANGED for _, fix in fixes]),
        sample=np.zeros(len(fixes), np.intp),
        poses=poses,
        **dict(zip(SCALARS, np.array(scalars).T, strict=True)),
    )
