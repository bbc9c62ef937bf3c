"""The one projection of a target into the camera, with its derivative by every error.

A target's *apparent* place is its true place plus the position's error: the place that the reported positions show.
The derivative by the target's north, east and height is therefore also the derivative by the position's error north,
east and up; the height's constant error has the same column as its error up. Flat ground, a fixed height, a roof, a
landmark and a slope are one row: they differ only in the target's height and its prior (`ground`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fwav_companion.estimation.array_rotations import apply, crosses, rotation_and_jacobian
from fwav_companion.estimation.errors import (
    CAMERA_DELAY,
    GIMBAL_DELAY,
    GIMBAL_HEADING,
    GIMBAL_SHARED,
    HEADING,
    HEIGHT,
    LEVER,
    MOUNT,
    PITCH,
    POSITION_DELAY,
    READOUT,
    ROLL,
    Array,
    Bools,
    Ints,
)

# Cosine of the largest angle between a predicted and an observed ray that is linearised: 87 degrees.
LEAST_COSINE = 0.05
# Ground points are bounded at this sine of a ray's depression; rays at the horizon have no foot.
LEAST_DEPRESSION = 0.15

_ROLL_AXIS = np.array([[1.0], [0.0], [0.0]])
_HEIGHT_IS_UP = np.array([[1.0], [1.0], [-1.0]])  # of down


class Poses(NamedTuple):
    """Reported state of the carrier at N instants, or at one (N = 1) that all sightings of a frame share."""

    rotation: Array  # (3, 3, N) ned_from_carrier
    position: Array  # (3, N) m north, east, height
    velocity: Array  # (3, N) m/s north, east, up
    calm_velocity: Array  # (3, N) m/s, without its noise, for derivatives
    rate: Array  # (3, N) rad/s, carrier axes, without its noise, for derivatives
    level: Array  # (3, N) or (3, 1) carrier axes: the axis about which the pitch turns: level, to the right
    own_rate: Array | None = None  # (3, N) rad/s, of a gimbal without the heading of its yaw's zero; None: `rate`

    def take(self, index: Ints) -> Poses:
        """The poses of instants (M,) by index."""
        rotation, position, velocity, calm, rate, level = (
            a if a.shape[-1] == 1 else a.take(index, -1) for a in self[:6]
        )
        own = None if self.own_rate is None else self.own_rate.take(index, -1)
        return Poses(rotation, position, velocity, calm, rate, level, own)


class Projection(NamedTuple):
    """M sightings linearised: residual is about shared @ correction + point @ correction of the apparent place."""

    residual: Array  # (2, M) observed minus predicted, standardised
    visible: Bools  # (M,) within 87 degrees of the observed ray
    height: Array  # (M,) m, camera above the target
    shared: Array  # (2, S, M) by the shared parameters
    point: Array  # (2, 3, M) by the apparent north, east and height


def project(
    poses: Poses, rays: Array, tangents: Array, shared: Array, target: Array, error: Array, row: Array
) -> Projection:
    """Predict sightings of targets and differentiate.

    poses: at the sightings' stamps minus the camera's delay; rays: (3, M) observed; tangents: (2, 3, M), from a
    direction to standardised units across the ray; shared: (S,); target: (3, M) true north, east, height; error:
    (3, M) or (3, 1) the position's error north, east, up; row: (M,) share of the readout at the sighting's row.
    """
    count = rays.shape[1]
    camera = poses.position + poses.velocity * shared[POSITION_DELAY] - error  # (3, N or M) true, but for the lever
    sight = np.empty((3, count))  # camera to target, NED
    sight[:2] = target[:2] - camera[:2]
    sight[2] = camera[2] - shared[HEIGHT] - target[2]
    lever = np.einsum("ijn,j->in", poses.rotation, shared[LEVER])
    sight += lever  # the reported lever is too large by the error: the true camera is nearer to the position by it
    height = sight[2].copy()

    bearing = float(shared[HEADING]) + (float(shared[GIMBAL_HEADING]) if len(shared) == GIMBAL_SHARED else 0.0)
    # The true attitude is the reported one turned back by the heading's error: v = R' Rz(error) sight.
    cos, sin = math.cos(bearing), math.sin(bearing)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    ned_axes = (turn.T @ poses.rotation.reshape(3, -1)).reshape(poses.rotation.shape)
    turned_axes = ned_axes.swapaxes(0, 1)  # (3, 3, N) NED axes, turned, in carrier axes
    v = apply(turned_axes, sight)  # (3, M) camera to target by the reported attitude

    axes = np.empty((3, 4, poses.rotation.shape[2]))  # carrier axes about which four errors turn v
    axes[:, 0], axes[:, 1], axes[:, 2], axes[:, 3] = poses.rate, turned_axes[:, 2], _ROLL_AXIS, poses.level
    turns = crosses(v, axes)  # (3, 4, M) by delay, heading, roll, pitch
    v = v + shared[ROLL] * turns[:, 2] + shared[PITCH] * turns[:, 3]
    mount, mount_jacobian = rotation_and_jacobian(shared[MOUNT])
    x = mount @ v  # reported mount = Exp(error) true mount: the nominal camera's directions are turned by the error

    depth = np.einsum("in,in->n", x, rays)
    visible = depth > LEAST_COSINE * np.sqrt(np.einsum("in,in->n", x, x))
    all_visible = bool(visible.all())
    if not all_visible:
        depth = np.where(visible, depth, 1.0)
    offset = apply(tangents, x) / depth  # (2, M)
    by_x = (tangents - offset[:, None] * rays) / depth  # (2, 3, M) standardised per metre of x
    by_v = mount.T @ by_x  # (2, 3, M)
    by_ned = apply(by_v, turned_axes)  # (2, 3, M)

    columns = np.empty((2, len(shared), count))
    turned = apply(by_v, turns)  # (2, 4, M)
    columns[:, CAMERA_DELAY], columns[:, HEADING : PITCH + 1] = turned[:, 0], turned[:, 1:]
    columns[:, MOUNT] = apply(by_x, crosses(x, mount_jacobian[..., None]))
    point = by_ned * _HEIGHT_IS_UP
    moved = apply(point, poses.calm_velocity)  # (2, M) by a second of the vehicle's motion
    # The pose is that of stamp - delay: a later delay turns the carrier back and moves it back.
    columns[:, CAMERA_DELAY] += moved
    columns[:, READOUT] = columns[:, CAMERA_DELAY] * row
    columns[:, HEIGHT] = point[:, 2]
    columns[:, POSITION_DELAY] = -moved
    columns[:, LEVER] = apply(by_ned, poses.rotation)
    if len(shared) == GIMBAL_SHARED:
        columns[:, GIMBAL_HEADING] = columns[:, HEADING]
        # Stamps of the gimbal that are late: the attitude of an instant is stored later, at + delay.
        own = poses.rate if poses.own_rate is None else poses.own_rate
        columns[:, GIMBAL_DELAY] = -apply(by_v, crosses(v, own[:, None]))[:, 0]
    if not all_visible:
        columns[..., ~visible], point[..., ~visible], offset[:, ~visible] = 0.0, 0.0, 0.0
    return Projection(-offset, visible, height, columns, point)


def without_path_noise(projection: Projection, path_noise: Array, rotation: Array) -> None:
    """Remove what only the path's noise adds to the height's columns, in place (errors in variables; Fuller 1987).

    A height error moves a ray's foot by the ray's slope, and the slope is known only as well as the path. The path's
    noise times its own effect on the residual does not average out and would be information on the height.
    path_noise: (2, M) m, the part of the horizontal path that is not motion; rotation: (3, 3, M) ned_from_carrier.
    """
    steeper = path_noise / np.maximum(projection.height, 0.2)
    less = (projection.point[:, :2] * steeper).sum(1)  # (2, M)
    projection.shared[:, HEIGHT] += less
    projection.point[:, 2] += less
    projection.shared[:, LEVER] -= less[:, None] * rotation[2]


def true_rays(poses: Poses, rays: Array, shared: Array) -> Array:
    """Directions (3, M) in NED of observed rays, corrected by the shared parameters."""
    mount, _ = rotation_and_jacobian(shared[MOUNT])
    v = mount.T @ rays
    tilt = np.zeros_like(poses.level)
    tilt[0] = shared[ROLL]
    v = v - np.cross(tilt + shared[PITCH] * poses.level, v, axis=0)
    ned = apply(poses.rotation, v)
    bearing = float(shared[HEADING]) + (float(shared[GIMBAL_HEADING]) if len(shared) == GIMBAL_SHARED else 0.0)
    cos, sin = math.cos(bearing), math.sin(bearing)
    return np.asarray(np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ ned)


def camera_positions(poses: Poses, shared: Array, error: Array) -> Array:
    """True camera positions (3, N): north, east, height, by the estimate."""
    camera = poses.position + poses.velocity * shared[POSITION_DELAY] - error
    lever = np.einsum("ijn,j->in", poses.rotation, shared[LEVER])
    camera[:2] -= lever[:2]
    camera[2] += lever[2] - shared[HEIGHT]
    return np.asarray(camera)


def feet(poses: Poses, rays: Array, shared: Array, error: Array, ground: float | Array = 0.0) -> tuple[Array, Bools]:
    """Ground points (2, M) of observed rays at ground heights, one or (M,), and which rays meet the ground."""
    camera, down = camera_positions(poses, shared, error), true_rays(poses, rays, shared)
    above = np.maximum(camera[2] - ground, 0.2)
    meets = down[2] > LEAST_DEPRESSION
    return camera[:2] + down[:2] / np.maximum(down[2], LEAST_DEPRESSION) * above, np.asarray(meets)
