"""What is handed in: sights of the tag placed in time, and the autopilot's attitude; and the arrays made of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians
from typing import TypeAlias

import msgspec
import numpy as np

from fwav_companion.geometry.rotations import Quaternion
from fwav_companion.geometry.stamps import NS_PER_S, BootNs
from fwav_companion.tools.shake.turns import Flags, Floats, log, matrices, transposed
from fwav_companion.types import Corners, Lens, NoRay

AttitudeAt: TypeAlias = Callable[[BootNs], Quaternion | None]
"""ned_from_body at an instant of the autopilot's clock; None where it is not known."""
RATE_REACH_S = 0.015
"""To both sides of an instant: attitudes err by 0.1 deg each, so that rates over 30 ms err by 5 deg/s, and not by 14 as
those of one interval at 100 Hz do. A wing at 5 Hz loses a thirtieth of its rate."""
WIDEST_ANGLE = radians(80.0)
"""From the optical axis: beyond, a corner has no place on a plane in front of the camera, and no lens is known well."""
LONGEST_STEP_S = 0.1
"""Between frames: over more, nothing moves evenly."""
LEAST_BEND_PX2 = 1.0
"""Of two sides at a corner, their cross product: a square of 24 pixels seen at 80 deg still bends by a hundred."""


class TagView(msgspec.Struct, frozen=True, gc=False):
    """The tag in one frame."""

    boot_ns: BootNs
    """Capture of row 0 on the autopilot's clock, as the configuration has it."""
    corners: Corners
    """In the pixels of the calibration, in the order of the print."""


class Looks(msgspec.Struct, frozen=True):
    """N frames as arrays."""

    times_s: Floats
    """(N,) of row 0, since the first frame."""
    rays: Floats
    """(N, 4, 3) unit rays of the corners, camera frame."""
    pixel_from_ray: Floats
    """(N, 4, 2, 3) d(pixel)/d(ray): how far in pixels a ray lies from another."""
    rows: Floats
    """(N, 4) of the corners, in heights of the image."""
    sides_px: Floats
    """(N,) the shortest side of the tag in the image."""
    backward: bool
    """The corners ran against the clock in the image, as those of a mirrored one do; they have been put in order."""

    def __len__(self) -> int:
        return len(self.times_s)

    def at_once(self, readout_s: float) -> Floats:
        """(N, 4, 3) unit rays as a shutter would have them that takes all rows at the mean instant of the four.

        By how fast each corner moved from frame to frame, which needs no model of anything.
        """
        if len(self) < 2 or readout_s == 0.0:
            return self.rays
        moved = np.gradient(self.rays, self.times_s + readout_s * self.rows.mean(axis=1), axis=0)
        apart_s = np.gradient(self.times_s)
        moved[apart_s > LONGEST_STEP_S] = 0.0
        early_s = readout_s * (self.rows.mean(axis=1, keepdims=True) - self.rows)
        rays = self.rays + moved * early_s[..., None]
        steady: Floats = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return steady

    def only(self, chosen: Flags) -> Looks:
        """Those frames."""
        return Looks(
            self.times_s[chosen],
            self.rays[chosen],
            self.pixel_from_ray[chosen],
            self.rows[chosen],
            self.sides_px[chosen],
            self.backward,
        )


def crossed(views: Sequence[TagView]) -> int:
    """In how many frames the sides cross: the corners are told in rows, as the letter Z is written, not round.

    Two of the four then bend with the clock and two against it; of a square seen from any side all bend alike.
    """
    bends = _bends(np.array([view.corners for view in views], dtype=np.float64).reshape(-1, 4, 2))
    with_clock, against = (bends > LEAST_BEND_PX2).sum(axis=1), (bends < -LEAST_BEND_PX2).sum(axis=1)
    return int(((with_clock == 2) & (against == 2)).sum())


def looks_of(views: Sequence[TagView], lens: Lens) -> Looks:
    """The frames whose corners the lens sees; all must be of one winding, which most decide.

    Views come in order of time; of two at one instant the first is taken, since a speed between them is none.
    """
    pixels = np.array([view.corners for view in views], dtype=np.float64).reshape(-1, 4, 2)
    origin_ns = views[0].boot_ns if views else 0
    times_s = np.array([(view.boot_ns - origin_ns) / NS_PER_S for view in views])
    area = _signed_area(pixels)
    backward = bool(np.median(area) < 0.0) if len(area) else False
    if backward:
        pixels = pixels[:, [0, 3, 2, 1]]
    rays, derivatives, seen = _through(lens, pixels)
    seen &= _convex(pixels)
    sides = np.linalg.norm(pixels - np.roll(pixels, 1, axis=1), axis=2).min(axis=1) if len(pixels) else times_s
    rows = pixels[:, :, 1] / lens.image_size[1]
    looks = Looks(times_s, rays, derivatives, rows, sides, backward).only(seen)
    return looks.only(np.diff(looks.times_s, prepend=-np.inf) > 0.0)


def _signed_area(pixels: Floats) -> Floats:
    """(N,) positive where the corners run with the clock, as a viewer of the image sees it."""
    following = np.roll(pixels, -1, axis=1)
    area: Floats = 0.5 * (pixels[..., 0] * following[..., 1] - pixels[..., 1] * following[..., 0]).sum(axis=1)
    return area


def _convex(pixels: Floats) -> Flags:
    """(N,) whether the corners run with the clock and bend at each, as those of a square do, seen from before."""
    least: Floats = _bends(pixels).min(axis=1)
    return least > LEAST_BEND_PX2


def _bends(pixels: Floats) -> Floats:
    """(N, 4) of each side to the next their cross product: positive where the corner between bends with the clock."""
    sides = np.roll(pixels, -1, axis=1) - pixels
    following = np.roll(sides, -1, axis=1)
    bends: Floats = sides[..., 0] * following[..., 1] - sides[..., 1] * following[..., 0]
    return bends


def _through(lens: Lens, pixels: Floats) -> tuple[Floats, Floats, Flags]:
    rays, derivatives = np.zeros((len(pixels), 4, 3)), np.zeros((len(pixels), 4, 2, 3))
    seen = np.ones(len(pixels), dtype=np.bool_)
    width, height = lens.image_size
    least = np.cos(min(WIDEST_ANGLE, lens.max_angle))
    for frame, four in enumerate(pixels.tolist()):
        for corner, (u, v) in enumerate(four):
            ray = lens.camera_ray_and_derivatives_from_pixel(u, v)
            inside = -0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5
            if isinstance(ray, NoRay) or not inside or ray.direction[2] < least:
                seen[frame] = False
                break
            rays[frame, corner] = ray.direction
            derivatives[frame, corner] = np.linalg.pinv(np.array([ray.d_du, ray.d_dv]).T)
    return rays, derivatives, seen


class Course:
    """The attitude at many instants, counted in seconds from an origin."""

    def __init__(self, attitude_at: AttitudeAt, origin_ns: BootNs) -> None:
        self._attitude_at, self._origin_ns = attitude_at, origin_ns

    def at(self, times_s: Floats) -> tuple[Floats, Flags]:
        """(..., 3, 3) ned_from_body of (...) instants, and (...) whether it is known."""
        instants, where = np.unique(times_s, return_inverse=True)
        quaternions = np.zeros((len(instants), 4))
        quaternions[:, 0] = 1.0
        known = np.ones(len(instants), dtype=np.bool_)
        for index, instant_s in enumerate(instants.tolist()):
            told = self._attitude_at(BootNs(self._origin_ns + round(instant_s * NS_PER_S)))
            if told is None:
                known[index] = False
            else:
                quaternions[index] = told
        where = where.reshape(times_s.shape)
        return matrices(quaternions)[where], known[where]

    def rates(self, times_s: Floats) -> tuple[Floats, Flags]:
        """(..., 3) angular velocities of the body, rad/s, body axes, and (...) whether they are known."""
        before, sure_before = self.at(times_s - RATE_REACH_S)
        after, sure_after = self.at(times_s + RATE_REACH_S)
        return log(transposed(before) @ after) / (2.0 * RATE_REACH_S), sure_before & sure_after
