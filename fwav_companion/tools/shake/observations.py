"""Inputs of the estimate as arrays: tag corners placed in time, the tag's poses, and attitudes at any instant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians
from typing import Final, TypeAlias

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.rotations import Quaternion
from fwav_companion.geometry.stamps import NS_PER_S, BootNs
from fwav_companion.types import Corners, Lens, NoRay

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]

AttitudeAt: TypeAlias = Callable[[BootNs], Quaternion | None]
"""ned_from_body at an instant of the autopilot's clock; None where it is not known."""

RATE_REACH_S: Final = 0.015
"""Time on both sides of an instant over which a rate is computed, seconds. Attitudes err by 0.1 deg each: rates over
30 ms err by 5 deg/s, but rates over one interval at 100 Hz by 14. A wing at 5 Hz loses a thirtieth of its rate."""
WIDEST_ANGLE: Final = radians(80.0)
"""Largest angle from the optical axis, radians. Beyond it a corner has no place on a plane in front of the camera, and
no lens is known well."""
LONGEST_STEP_S: Final = 0.1
"""Longest time between two frames over which the motion is assumed to be even, seconds."""
LEAST_BEND_PX2: Final = 1.0
"""Least cross product of the two sides at a corner, px^2. A square of 24 pixels seen at 80 deg still has a hundred."""

SQUARE: Final = np.array([(-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0)])
"""(4, 3) corners of a square of side 1 in the tag frame, in the order of the print. Tag frame: x to the right of the
print, y down the print, z away from its reader; on the ground, face up, z is down."""
_IPPE_FROM_TAG: Final = np.diag([1.0, -1.0, -1.0])
"""Rotation from the tag frame to that of OpenCV's SOLVEPNP_IPPE_SQUARE, which has y up the print and z toward the
reader, and the same order of the corners."""


class TagObservation(msgspec.Struct, frozen=True, gc=False):
    """The tag in one frame."""

    boot_ns: BootNs
    """Capture of row 0 on the autopilot's clock, by the configured delay."""
    corners: Corners
    """Pixels of the calibration's image size, in the order of the print."""


class TagObservations(msgspec.Struct, frozen=True):
    """N observations as arrays, in order of time."""

    times_s: Floats
    """(N,) capture of row 0, seconds since the first frame."""
    rays: Floats
    """(N, 4, 3) unit rays of the corners, camera frame."""
    pixel_from_ray: Floats
    """(N, 4, 2, 3) d(pixel)/d(ray)."""
    rows: Floats
    """(N, 4) rows of the corners, in image heights."""
    sides_px: Floats
    """(N,) shortest side of the tag in the image."""
    backward: bool
    """Whether the corners ran counterclockwise in the image, as a mirrored tag's do. They have been put in order."""

    def __len__(self) -> int:
        return len(self.times_s)

    def global_shutter_rays(self, readout_s: float) -> Floats:
        """(N, 4, 3) unit rays as a global shutter would see them at the mean capture instant of the four corners.

        The corners' own motion from frame to frame gives the displacement, so this needs no model of the scene.
        """
        if len(self) < 2 or readout_s == 0.0:
            return self.rays
        moved = np.gradient(self.rays, self.times_s + readout_s * self.rows.mean(axis=1), axis=0)
        moved[np.gradient(self.times_s) > LONGEST_STEP_S] = 0.0
        early_s = readout_s * (self.rows.mean(axis=1, keepdims=True) - self.rows)
        rays = self.rays + moved * early_s[..., None]
        steady: Floats = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return steady

    def only(self, chosen: Flags) -> TagObservations:
        """The chosen observations."""
        return TagObservations(
            times_s=self.times_s[chosen],
            rays=self.rays[chosen],
            pixel_from_ray=self.pixel_from_ray[chosen],
            rows=self.rows[chosen],
            sides_px=self.sides_px[chosen],
            backward=self.backward,
        )


def observations_from_tags(tags: Sequence[TagObservation], lens: Lens) -> TagObservations:
    """The observations whose four corners the lens sees and whose winding is that of the majority.

    ``tags`` are in order of time. Of two at one instant the first is taken: no speed between them can be computed.
    """
    pixels = _corner_pixels(tags)
    origin_ns = tags[0].boot_ns if tags else 0
    times_s = np.array([(tag.boot_ns - origin_ns) / NS_PER_S for tag in tags])
    area = _signed_area(pixels)
    backward = bool(np.median(area) < 0.0) if len(area) else False
    if backward:
        pixels = pixels[:, [0, 3, 2, 1]]
    rays, pixel_from_ray, seen = _through_lens(lens, pixels)
    seen &= (_bends(pixels) > LEAST_BEND_PX2).all(axis=1)  # convex and clockwise, as a square seen from its front
    sides_px = np.linalg.norm(pixels - np.roll(pixels, 1, axis=1), axis=2).min(axis=1) if len(pixels) else times_s
    observations = TagObservations(
        times_s=times_s,
        rays=rays,
        pixel_from_ray=pixel_from_ray,
        rows=pixels[:, :, 1] / lens.image_size[1],
        sides_px=sides_px,
        backward=backward,
    ).only(seen)
    return observations.only(np.diff(observations.times_s, prepend=-np.inf) > 0.0)


def crossed(tags: Sequence[TagObservation]) -> int:
    """Number of observations whose sides cross: the detector sends the corners in rows, as the letter Z is written.

    Two of the four corners then bend clockwise and two counterclockwise; all four corners of a square bend alike.
    """
    bends = _bends(_corner_pixels(tags))
    clockwise, counterclockwise = (bends > LEAST_BEND_PX2).sum(axis=1), (bends < -LEAST_BEND_PX2).sum(axis=1)
    return int(((clockwise == 2) & (counterclockwise == 2)).sum())


def square_poses(rays: Floats) -> tuple[Rotation, Floats]:
    """Poses of a square of side 1 by the (N, 4, 3) rays to its corners: camera_from_tag, and the (N, 3) middles.

    IPPE (Collins and Bartoli 2014). A small square seen nearly from its front has two poses, tilted to either side;
    OpenCV gives both, the one with the smaller reprojection error first.
    """
    object_points = SQUARE @ _IPPE_FROM_TAG
    rotation_vectors, middles = np.zeros((len(rays), 3)), np.zeros((len(rays), 3))
    for index, image_points in enumerate(rays[:, :, :2] / rays[:, :, 2:]):
        _, vectors, places, _ = cv2.solvePnPGeneric(
            object_points, image_points, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        rotation_vectors[index], middles[index] = vectors[0].ravel(), places[0].ravel()
    return Rotation.from_rotvec(rotation_vectors) * Rotation.from_matrix(_IPPE_FROM_TAG), middles


class AttitudeSeries:
    """Attitudes at many instants, in seconds since an origin on the autopilot's clock."""

    def __init__(self, attitude_at: AttitudeAt, origin_ns: BootNs) -> None:
        self._attitude_at, self._origin_ns = attitude_at, origin_ns

    def at(self, times_s: Floats) -> tuple[Rotation, Flags]:
        """N rotations ned_from_body at (N,) instants, and (N,) whether each is known; the identity where not."""
        quaternions = np.tile([1.0, 0.0, 0.0, 0.0], (len(times_s), 1))
        known = np.zeros(len(times_s), dtype=np.bool_)
        for index, time_s in enumerate(times_s.tolist()):
            attitude = self._attitude_at(BootNs(self._origin_ns + round(time_s * NS_PER_S)))
            if attitude is not None:
                quaternions[index], known[index] = attitude, True
        return rotation_from_quaternions(quaternions), known

    def rates(self, times_s: Floats) -> tuple[Floats, Flags]:
        """(N, 3) angular velocities of the body, body axes, rad/s, and (N,) whether each is known."""
        before, before_known = self.at(times_s - RATE_REACH_S)
        after, after_known = self.at(times_s + RATE_REACH_S)
        rates: Floats = (before.inv() * after).as_rotvec() / (2.0 * RATE_REACH_S)
        return rates, before_known & after_known


def rotation_from_quaternions(quaternions: Floats) -> Rotation:
    """Rotations of (N, 4) quaternions in this project's order (w, x, y, z); scipy's is (x, y, z, w)."""
    return Rotation.from_quat(quaternions[:, [1, 2, 3, 0]])


def _corner_pixels(tags: Sequence[TagObservation]) -> Floats:
    return np.array([tag.corners for tag in tags], dtype=np.float64).reshape(-1, 4, 2)


def _signed_area(pixels: Floats) -> Floats:
    """(N,) areas, positive where the corners run clockwise in the image as displayed."""
    following = np.roll(pixels, -1, axis=1)
    area: Floats = 0.5 * (pixels[..., 0] * following[..., 1] - pixels[..., 1] * following[..., 0]).sum(axis=1)
    return area


def _bends(pixels: Floats) -> Floats:
    """(N, 4) cross products of each side and the next, positive where the corner between them bends clockwise."""
    sides = np.roll(pixels, -1, axis=1) - pixels
    following = np.roll(sides, -1, axis=1)
    bends: Floats = sides[..., 0] * following[..., 1] - sides[..., 1] * following[..., 0]
    return bends


def _through_lens(lens: Lens, pixels: Floats) -> tuple[Floats, Floats, Flags]:
    """Rays, d(pixel)/d(ray), and whether the lens sees all four corners inside the image."""
    rays, ray_from_pixel = np.zeros((len(pixels), 4, 3)), np.zeros((len(pixels), 4, 3, 2))
    seen = np.ones(len(pixels), dtype=np.bool_)
    width, height = lens.image_size
    least_z = np.cos(min(WIDEST_ANGLE, lens.max_angle))
    for frame, corners in enumerate(pixels.tolist()):
        for corner, (u, v) in enumerate(corners):
            ray = lens.camera_ray_and_derivatives_from_pixel(u, v)
            inside = -0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5
            if isinstance(ray, NoRay) or not inside or ray.direction[2] < least_z:
                seen[frame] = False
                break
            rays[frame, corner] = ray.direction
            ray_from_pixel[frame, corner, :, 0], ray_from_pixel[frame, corner, :, 1] = ray.d_du, ray.d_dv
    return rays, np.linalg.pinv(ray_from_pixel).astype(np.float64, copy=False), seen
