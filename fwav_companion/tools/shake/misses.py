"""By how many pixels an estimate misses the tag's corners, frame by frame, and how that moves with what is unknown.

    point in the camera = camera_from_body * body_from_ned(row's capture - delay) * (corner in NED - camera's place)

The camera's place is each frame's own and is worked out of it again (nobody knows how a hand moves). Common to all are
the delay, the mount, an unknown readout, the slope of the ground the tag lies on, and the tag's heading, which may
drift: a compass held in a hand does. The slope is what the turn by a quarter tells from the mount.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from fwav_companion.tools.shake.looks import Course, Looks
from fwav_companion.tools.shake.square_pose import SQUARE
from fwav_companion.tools.shake.turns import Flags, Floats, exp, skew, transposed

DELAY: Final = 0
MOUNT: Final = slice(1, 4)
READOUT: Final = 4
SLOPE: Final = slice(5, 7)
HEADINGS: Final = 7
"""The columns of the unknowns; the headings' knots are the rest."""
KNOT_S: Final = 2.5
TRIED: Final = 1e-4
"""rad: the mount's derivatives are taken by trying, since the speeds of the hand hang on it too."""
FREE_PER_FRAME: Final = 5.0
"""Eight pixels of four corners, less the camera's place."""
FREE_PER_UNKNOWN: Final = 4
"""At least: fewer frames would let the unknowns follow their noise."""
SMOOTHED: Final = 9
"""Frames over which the hand's speed is taken: a third of a second, in which an arm does not turn back."""


class Estimate(msgspec.Struct, frozen=True):
    """What is common to all frames."""

    delay_s: float
    camera_from_body: Floats
    """(3, 3) a rotation."""
    readout_s: float
    slope: Floats
    """(2,) of the ground, radians about north and east."""
    headings: Floats
    """(knots,) of the tag, radians, every KNOT_S."""

    def stepped(self, step: Floats) -> Estimate:
        """``step``: in the order of the columns; the mount's is a rotation vector in body axes."""
        return Estimate(
            delay_s=float(self.delay_s + step[DELAY]),
            camera_from_body=self.camera_from_body @ exp(-step[MOUNT]),
            readout_s=float(self.readout_s + step[READOUT]),
            slope=self.slope + step[SLOPE],
            headings=self.headings + step[HEADINGS:],
        )


class Poses(msgspec.Struct, frozen=True):
    """How the body stood and turned when each corner's row was taken, by a delay and a readout."""

    body_from_ned: Floats
    """(N, 4, 3, 3)."""
    rates: Floats
    """(N, 1, 3) rad/s, body axes."""
    rows_s: Floats
    """(N, 4) from the mean instant of the four to each corner's own."""
    used: Flags
    """(N,) whether that is known."""

    @property
    def rolled(self) -> bool:
        """The rows of a frame were not taken at once."""
        return bool(self.rows_s.any())


class Misses(msgspec.Struct, frozen=True):
    """How far off an estimate is, in pixels."""

    residual: Floats
    """(N, 8) where the corners should be, less where they are."""
    jacobian: Floats
    """(N, 8, unknowns) the same by the estimate."""
    by_place: Floats
    """(N, 8, 3) the same by where the tag is from the camera, metres NED."""


class SeenTag:
    """The tag as it was seen, against what an estimate expects."""

    def __init__(self, looks: Looks, course: Course, tag_size_m: float) -> None:
        self._looks, self._course, self._size_m = looks, course, tag_size_m
        self.times_s = looks.times_s
        self.knots = 2 + int(np.ptp(looks.times_s) / KNOT_S)
        self._hats = _hats(looks.times_s, looks.times_s.min() + KNOT_S * np.arange(self.knots))

    def poses(self, delay_s: float, readout_s: float) -> Poses | None:
        """Of the body meanwhile; None where attitudes are missing for most frames, or too few frames are left."""
        looks = self._looks
        instants_s = looks.times_s[:, None] + readout_s * looks.rows - delay_s
        middles_s = instants_s.mean(axis=1)
        ned_from_body, known = self._course.at(middles_s)
        rates, sure = self._course.rates(middles_s)
        used = known & sure
        unknowns = HEADINGS + self.knots
        if used.sum() < len(looks) / 2 or used.sum() * FREE_PER_FRAME < FREE_PER_UNKNOWN * unknowns:
            return None
        rates = rates[:, None, :]
        rows_s = instants_s - middles_s[:, None]
        within = exp(rates * rows_s[..., None])
        return Poses(transposed(ned_from_body[:, None] @ within), rates, rows_s, used)

    def heading(self, camera_from_body: Floats, poses: Poses) -> float:
        """Of the tag, by such a mount: the mean over the frames, as a direction."""
        rays = self._rays_ned(camera_from_body @ poses.body_from_ned)
        flat = rays[..., :2] / np.maximum(rays[..., 2:], 0.05)
        along = (flat[:, 1] - flat[:, 0] + flat[:, 2] - flat[:, 3])[poses.used]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        north, east = along.mean(axis=0)
        return float(np.arctan2(east, north))

    def misses(self, estimate: Estimate, poses: Poses) -> Misses:
        """``poses``: by the delay and readout of the estimate."""
        corners = self._corners_ned(estimate)
        arms, camera_from_ned = self._arms(estimate.camera_from_body, corners, poses)
        residual, by_point = self._residual(arms, camera_from_ned)
        frames = len(residual)
        jacobian = np.zeros((frames, 8, HEADINGS + self.knots))
        later = np.cross(poses.rates, (poses.body_from_ned @ arms[..., None])[..., 0])
        by_delay = by_point @ (transposed(poses.body_from_ned) @ later[..., None])  # the attitude is an earlier one
        jacobian[:, :, DELAY] = by_delay.reshape(frames, 8)
        jacobian[:, :, READOUT] = -(by_delay[..., 0] * self._looks.rows[..., None]).reshape(frames, 8)
        by_turn = (-by_point @ skew(corners)).reshape(frames, 8, 3)
        jacobian[:, :, SLOPE] = by_turn[..., :2]
        jacobian[:, :, HEADINGS:] = by_turn[..., 2:] * self._hats[:, None, :]
        for axis in range(3):
            mount = estimate.camera_from_body @ exp(-TRIED * np.eye(3)[axis])
            turned, _ = self._residual(*self._arms(mount, corners, poses))
            jacobian[:, :, MOUNT.start + axis] = (turned - residual) / TRIED
        return Misses(residual, jacobian, by_point.reshape(frames, 8, 3))

    def _corners_ned(self, estimate: Estimate) -> Floats:
        """(N, 4, 3) metres from the tag's middle."""
        headings = self._hats @ estimate.headings
        turned = exp(np.stack([np.zeros_like(headings), np.zeros_like(headings), headings], axis=-1))
        slope = exp(np.array([*estimate.slope, 0.0]))
        corners: Floats = (slope @ turned)[:, None] @ (self._size_m * SQUARE)[None, :, :, None]
        return corners[..., 0]

    def _arms(self, camera_from_body: Floats, corners: Floats, poses: Poses) -> tuple[Floats, Floats]:
        """(N, 4, 3) the corners from the camera in NED, and (N, 4, 3, 3) camera_from_ned, with such a mount.

        Each frame's place is the point nearest to its four rays; where rows differ in time the hand's speed counts.
        """
        camera_from_ned = camera_from_body @ poses.body_from_ned
        rays = self._rays_ned(camera_from_ned)
        across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
        drift = np.zeros_like(rays)
        for _ in range(2 if poses.rolled else 1):
            right = (across @ (corners - drift)[..., None]).sum(axis=1)
            place = np.linalg.solve(across.sum(axis=1), right)[..., 0]
            drift = poses.rows_s[..., None] * _speeds(place, self.times_s)[:, None, :]
        return corners - place[:, None, :] - drift, camera_from_ned

    def _rays_ned(self, camera_from_ned: Floats) -> Floats:
        rays: Floats = (transposed(camera_from_ned) @ self._looks.rays[..., None])[..., 0]
        return rays

    def _residual(self, arms: Floats, camera_from_ned: Floats) -> tuple[Floats, Floats]:
        """(N, 8) pixels by which the corners are missed, (N, 4, 2, 3) the same by the point in NED."""
        points = (camera_from_ned @ arms[..., None])[..., 0]
        length = np.linalg.norm(points, axis=-1, keepdims=True)
        direction = points / length
        across = (np.eye(3) - direction[..., :, None] * direction[..., None, :]) / length[..., None]
        residual = (self._looks.pixel_from_ray @ (direction - self._looks.rays)[..., None])[..., 0]
        return residual.reshape(-1, 8), self._looks.pixel_from_ray @ across @ camera_from_ned


def _hats(times_s: Floats, knots_s: Floats) -> Floats:
    """(N, knots) weights of straight lines between knots."""
    hats: Floats = np.maximum(0.0, 1.0 - np.abs(times_s[:, None] - knots_s[None, :]) / KNOT_S)
    return hats


def _speeds(places: Floats, times_s: Floats) -> Floats:
    """(N, 3) metres per second, smoothed."""
    kernel = np.ones(SMOOTHED) / SMOOTHED
    speeds = np.gradient(places, times_s, axis=0)
    padded = np.pad(speeds, ((SMOOTHED // 2, SMOOTHED // 2), (0, 0)), mode="edge")
    return np.stack([np.convolve(padded[:, axis], kernel, "valid") for axis in range(3)], axis=1)
