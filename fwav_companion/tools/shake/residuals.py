"""Reprojection residuals of the tag's corners, frame by frame, and their Jacobian by the unknowns.

    point in the camera = camera_from_body * body_from_ned(row's capture - delay) * (corner in NED - camera position)

The camera position is a parameter of each frame, since a hand's path is not known, and is eliminated. Common to all
frames are the delay, the mount, an unknown readout, the slope of the ground on which the tag lies, and the tag's
heading, which may drift: a compass held in a hand does. The turn by 90 deg separates the slope from the mount.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from fwav_companion.tools.shake.observations import SQUARE, AttitudeSeries, Flags, Floats, TagObservations

DELAY: Final = 0
MOUNT: Final = slice(1, 4)
READOUT: Final = 4
SLOPE: Final = slice(5, 7)
HEADINGS: Final = 7
"""Columns of the unknowns; the columns from HEADINGS on are the knots of the heading."""
KNOT_S: Final = 2.5
"""Seconds between two knots of the heading."""
MOUNT_STEP: Final = 1e-4
"""Step of the numeric derivatives by the mount, radians. They are numeric because the camera's speed depends on the
mount, too."""
SMOOTHED: Final = 9
"""Frames over which the camera's speed is averaged: a third of a second, in which an arm does not reverse."""


class CornerParameters(msgspec.Struct, frozen=True):
    """Parameters common to all frames."""

    delay_s: float
    camera_from_body: Floats
    """(3, 3) rotation."""
    readout_s: float
    slope: Floats
    """(2,) slope of the ground, radians about north and east."""
    headings: Floats
    """(knots,) headings of the tag, radians, every KNOT_S."""

    def moved(self, step: Floats) -> CornerParameters:
        """The parameters after a step in the order of the columns; the mount's is a rotation vector in body axes."""
        return CornerParameters(
            delay_s=float(self.delay_s + step[DELAY]),
            camera_from_body=self.camera_from_body @ _matrices(-step[MOUNT]),
            readout_s=float(self.readout_s + step[READOUT]),
            slope=self.slope + step[SLOPE],
            headings=self.headings + step[HEADINGS:],
        )


class BodyMotion(msgspec.Struct, frozen=True):
    """Attitude and rates of the body at each corner's capture, for a given delay and readout."""

    body_from_ned: Floats
    """(N, 4, 3, 3) rotations at the corners' captures."""
    rates: Floats
    """(N, 1, 3) rad/s, body axes."""
    rows_s: Floats
    """(N, 4) time from the mean capture of the four corners to each corner's own, seconds."""
    known: Flags
    """(N,) whether attitude and rates are known."""

    @property
    def rolling(self) -> bool:
        """Whether the rows of a frame have different capture times."""
        return bool(self.rows_s.any())


class CornerResiduals(msgspec.Struct, frozen=True):
    """Residuals in pixels, modelled minus observed, and their derivatives."""

    residual: Floats
    """(N, 8) residuals."""
    jacobian: Floats
    """(N, 8, unknowns) derivatives by the unknowns."""
    by_position: Floats
    """(N, 8, 3) derivatives by the tag's position relative to the camera, metres NED."""
    motion: BodyMotion


class CornerModel:
    """Models the tag's corners in all frames and compares them with the observations."""

    def __init__(self, observations: TagObservations, attitudes: AttitudeSeries, tag_size_m: float) -> None:
        self._observations, self._attitudes, self._size_m = observations, attitudes, tag_size_m
        self.times_s = observations.times_s
        self.knots = 2 + int(np.ptp(self.times_s) / KNOT_S)
        self._knot_weights = _knot_weights(self.times_s, self.times_s.min() + KNOT_S * np.arange(self.knots))

    @property
    def unknowns(self) -> int:
        """Number of columns."""
        return HEADINGS + self.knots

    def motion(self, delay_s: float, readout_s: float) -> BodyMotion:
        """The body's motion at the corners' capture times."""
        instants_s = self.times_s[:, None] + readout_s * self._observations.rows - delay_s
        middles_s = instants_s.mean(axis=1)
        ned_from_body, attitude_known = self._attitudes.at(middles_s)
        rates, rates_known = self._attitudes.rates(middles_s)
        rows_s = instants_s - middles_s[:, None]
        since_middle = _matrices(rates[:, None, :] * rows_s[..., None])
        at_corners = ned_from_body.as_matrix()[:, None] @ since_middle
        return BodyMotion(_transposed(at_corners), rates[:, None, :], rows_s, attitude_known & rates_known)

    def heading(self, camera_from_body: Floats, motion: BodyMotion) -> float:
        """Heading of the tag for a mount: the mean direction over the frames, radians."""
        rays = self._rays_ned(camera_from_body @ motion.body_from_ned)
        flat = rays[..., :2] / np.maximum(rays[..., 2:], 0.05)
        along = (flat[:, 1] - flat[:, 0] + flat[:, 2] - flat[:, 3])[motion.known]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        north, east = along.mean(axis=0)
        return float(np.arctan2(east, north))

    def residuals(self, parameters: CornerParameters) -> CornerResiduals:
        """Residuals and derivatives at these parameters."""
        motion = self.motion(parameters.delay_s, parameters.readout_s)
        corners = self._corners_ned(parameters)
        arms, camera_from_ned = self._arms(parameters.camera_from_body, corners, motion)
        residual, by_point = self._residual(arms, camera_from_ned)
        frames = len(residual)
        jacobian = np.zeros((frames, 8, self.unknowns))
        by_delay = self._by_delay(arms, by_point, motion)
        jacobian[:, :, DELAY] = by_delay.reshape(frames, 8)
        jacobian[:, :, READOUT] = -(by_delay * self._observations.rows[..., None]).reshape(frames, 8)
        by_turn = np.cross(corners[:, :, None, :], by_point).reshape(frames, 8, 3)  # corners about NED's axes
        jacobian[:, :, SLOPE] = by_turn[..., :2]
        jacobian[:, :, HEADINGS:] = by_turn[..., 2:] * self._knot_weights[:, None, :]
        for axis in range(3):
            mount = parameters.camera_from_body @ _matrices(-MOUNT_STEP * np.eye(3)[axis])
            turned, _ = self._residual(*self._arms(mount, corners, motion))
            jacobian[:, :, MOUNT.start + axis] = (turned - residual) / MOUNT_STEP
        return CornerResiduals(residual, jacobian, by_point.reshape(frames, 8, 3), motion)

    def _by_delay(self, arms: Floats, by_point: Floats, motion: BodyMotion) -> Floats:
        """(N, 4, 2) d(residual)/d(delay): a larger delay means an earlier attitude."""
        moved = np.cross(motion.rates, (motion.body_from_ned @ arms[..., None])[..., 0])
        by_delay: Floats = (by_point @ (_transposed(motion.body_from_ned) @ moved[..., None]))[..., 0]
        return by_delay

    def _corners_ned(self, parameters: CornerParameters) -> Floats:
        """(N, 4, 3) metres from the tag's middle."""
        headings = self._knot_weights @ parameters.headings
        turned = Rotation.from_euler("z", headings[:, None]).as_matrix()
        slope = _matrices(np.array([*parameters.slope, 0.0]))
        corners: Floats = self._size_m * SQUARE @ _transposed(slope @ turned)
        return corners

    def _arms(self, camera_from_body: Floats, corners: Floats, motion: BodyMotion) -> tuple[Floats, Floats]:
        """(N, 4, 3) corners from the camera in NED, and (N, 4, 3, 3) camera_from_ned, for a mount.

        The camera position of each frame is the point nearest to its four rays. Under a rolling shutter the camera
        moves between the rows by its own speed.
        """
        camera_from_ned = camera_from_body @ motion.body_from_ned
        rays = self._rays_ned(camera_from_ned)
        across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
        drift = np.zeros_like(rays)
        for _ in range(2 if motion.rolling else 1):
            right = (across @ (corners - drift)[..., None]).sum(axis=1)
            position = np.linalg.solve(across.sum(axis=1), right)[..., 0]
            drift = motion.rows_s[..., None] * _speeds(position, self.times_s)[:, None, :]
        return corners - position[:, None, :] - drift, camera_from_ned

    def _rays_ned(self, camera_from_ned: Floats) -> Floats:
        rays: Floats = (_transposed(camera_from_ned) @ self._observations.rays[..., None])[..., 0]
        return rays

    def _residual(self, arms: Floats, camera_from_ned: Floats) -> tuple[Floats, Floats]:
        """(N, 8) residuals in pixels, and (N, 4, 2, 3) their derivatives by the corner in NED."""
        points = (camera_from_ned @ arms[..., None])[..., 0]
        length = np.linalg.norm(points, axis=-1, keepdims=True)
        direction = points / length
        across = (np.eye(3) - direction[..., :, None] * direction[..., None, :]) / length[..., None]
        pixel_from_ray = self._observations.pixel_from_ray
        residual = (pixel_from_ray @ (direction - self._observations.rays)[..., None])[..., 0]
        return residual.reshape(-1, 8), pixel_from_ray @ across @ camera_from_ned


def _matrices(rotation_vectors: Floats) -> Floats:
    """(..., 3, 3) rotation matrices of (..., 3) vectors; scipy before 1.17 takes one leading axis at most."""
    flat = Rotation.from_rotvec(rotation_vectors.reshape(-1, 3)).as_matrix()
    matrices: Floats = flat.reshape(*rotation_vectors.shape[:-1], 3, 3)
    return matrices


def _transposed(matrices: Floats) -> Floats:
    return np.swapaxes(matrices, -1, -2)


def _knot_weights(times_s: Floats, knots_s: Floats) -> Floats:
    """(N, knots) weights of linear interpolation between knots."""
    weights: Floats = np.maximum(0.0, 1.0 - np.abs(times_s[:, None] - knots_s[None, :]) / KNOT_S)
    return weights


def _speeds(positions: Floats, times_s: Floats) -> Floats:
    """(N, 3) smoothed velocities, metres per second."""
    kernel = np.ones(SMOOTHED) / SMOOTHED
    speeds = np.gradient(positions, times_s, axis=0)
    padded = np.pad(speeds, ((SMOOTHED // 2, SMOOTHED // 2), (0, 0)), mode="edge")
    return np.stack([np.convolve(padded[:, axis], kernel, "valid") for axis in range(3)], axis=1)
