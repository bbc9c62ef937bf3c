"""How every error of a sighting moves the point where its ray meets the ground: columns of derivatives.

A point is p = c + s d: the camera, the distance, the unit ray. With n the ground's normal and m = n / (n . d), a change
x of the ray moves it by s (x - (m . x) d), and a change y of the camera by y - (m . y) d: along the ray, back to the
surface. A small rotation w of what carries the ray changes it by w x d, and the distance by the fraction w . (d x m).

On level ground nothing moves a point up or down, and the columns say so exactly, not to rounding: filters take them
for what they are.

Left out: that the camera's centre turns with the vehicle about its own point of reference. A lever of 0.3 m and one
degree are 5 mm.
"""

from __future__ import annotations

from typing import TypeAlias

import msgspec

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.vectors import (
    ZERO3,
    Matrix3,
    Vector3,
    add,
    cross,
    dot,
    scale,
    transform,
    transpose,
)
from fwav_companion.localization.ground import LEVEL_NORMAL, Intersection
from fwav_companion.types import Sighting

Columns: TypeAlias = tuple[Vector3, ...]

NOWHERE: Columns = (ZERO3, ZERO3)
ALONG: Columns = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


class RangeSensitivity(msgspec.Struct, frozen=True, gc=False):
    """The relative change of the ray's length per unit of each error that turns the ray: all that is not linear."""

    body: Vector3
    """Per radian about the axes of the body, or of the gimbal that carries the camera."""
    heading: float
    """Per radian about down."""
    pixel: tuple[float, float]
    """Per pixel of u and v."""
    time: float
    """Per second."""


class Propagation(msgspec.Struct, frozen=True, gc=False):
    """Derivatives of the point, NED, by every error: estimate minus truth per unit."""

    pixel_u: Vector3
    """Per pixel."""
    pixel_v: Vector3
    biases: Columns
    """By :class:`Bias`."""
    stretch: RangeSensitivity


def propagate(sighting: Sighting, direction: Vector3, meeting: Intersection) -> Propagation:
    """The columns at the meeting of the unit ray ``direction``, NED, with the ground."""
    m = scale(meeting.normal, 1.0 / dot(meeting.normal, direction))
    deeper = scale(direction, m[2])  # a metre more between the camera and the ground's level
    turned = cross(direction, m)
    by_rotation = _by_rotation(direction, turned, meeting)
    body_axes = transpose(matrix_from_quaternion(sighting.state.ned_from_carrier))
    x_axis, y_axis, z_axis = body_axes
    roll, pitch, yaw = transform(by_rotation, x_axis), transform(by_rotation, y_axis), transform(by_rotation, z_axis)
    heading = (by_rotation[0][2], by_rotation[1][2], by_rotation[2][2])
    # The true mount is Exp(bias) times the configured one, so the estimate is turned the other way.
    mount_x, mount_y, mount_z = scale(roll, -1.0), scale(pitch, -1.0), scale(yaw, -1.0)
    height = _by_height(sighting, meeting, deeper)
    lift = meeting.height_by_rotation
    if (
        lift is not ZERO3 and sighting.state.gimbal is None
    ):  # a beam turns with the vehicle, and the height changes with it
        roll, pitch, yaw = (
            add(turn, scale(height, dot(axis, lift))) for turn, axis in zip((roll, pitch, yaw), body_axes, strict=True)
        )
        heading = add(heading, scale(height, lift[2]))
    time = _by_time(sighting, direction, meeting, m, (roll, pitch, yaw))
    pixel_u, stretch_u = _by_ray(transform(sighting.ned_from_camera, sighting.ray.d_du), direction, meeting, m)
    pixel_v, stretch_v = _by_ray(transform(sighting.ned_from_camera, sighting.ray.d_dv), direction, meeting, m)
    north, east = _by_place(sighting, direction, meeting, m)
    readout = scale(time, sighting.row_fraction)
    terrain = scale(deeper, -1.0) if meeting.surveyed else ZERO3
    stretch_body = transform(body_axes, turned)
    return Propagation(
        pixel_u,
        pixel_v,
        (roll, pitch, heading, mount_x, mount_y, mount_z, time, readout, height, north, east, terrain),
        RangeSensitivity(
            stretch_body, turned[2], (stretch_u, stretch_v), dot(stretch_body, sighting.state.carrier_rates)
        ),
    )


def _by_rotation(d: Vector3, turned: Vector3, meeting: Intersection) -> Matrix3:
    """D(point)/d(rotation vector, NED) of the ray; on level ground no rotation moves the point up or down."""
    (x, y, z), (tx, ty, tz), s = d, turned, meeting.distance_m
    return (
        (s * (-x * tx), s * (z - x * ty), s * (-y - x * tz)),
        (s * (-z - y * tx), s * (-y * ty), s * (x - y * tz)),
        ZERO3 if meeting.normal is LEVEL_NORMAL else (s * (y - z * tx), s * (-x - z * ty), s * (-z * tz)),
    )


def _by_ray(x: Vector3, d: Vector3, meeting: Intersection, m: Vector3) -> tuple[Vector3, float]:
    """The point's change with a change x of the ray, and the stretch that comes with it."""
    along, s = m[0] * x[0] + m[1] * x[1] + m[2] * x[2], meeting.distance_m
    return (s * (x[0] - along * d[0]), s * (x[1] - along * d[1]), s * (x[2] - along * d[2])), -along


def _by_time(sighting: Sighting, d: Vector3, meeting: Intersection, m: Vector3, turns: Columns) -> Vector3:
    """The point's change with a second of the vehicle's motion. A velocity that is not told counts as none."""
    (p, q, r), velocity = sighting.state.carrier_rates, sighting.state.velocity_ned
    (x0, x1, x2), (y0, y1, y2), (z0, z1, z2) = turns
    north, east, down = velocity or ZERO3
    if sighting.relative:  # the world goes along with the vehicle; only its height changes
        north, east, down = 0.0, 0.0, 0.0 if meeting.carried else down
    along = 0.0 if meeting.carried else m[0] * north + m[1] * east + m[2] * down
    level = meeting.normal is LEVEL_NORMAL and not meeting.carried
    return (
        p * x0 + q * y0 + r * z0 + north - along * d[0],
        p * x1 + q * y1 + r * z1 + east - along * d[1],
        0.0 if level else p * x2 + q * y2 + r * z2 + down - along * d[2],
    )


def _by_height(sighting: Sighting, meeting: Intersection, deeper: Vector3) -> Vector3:
    """A metre too much between camera and ground: the camera is told too high, unless the ground is told from it."""
    if meeting.carried and not sighting.relative:
        return deeper
    return (deeper[0], deeper[1], 0.0 if meeting.normal is LEVEL_NORMAL else deeper[2] - 1.0)


def _by_place(sighting: Sighting, d: Vector3, meeting: Intersection, m: Vector3) -> Columns:
    """On level ground the point goes where the vehicle goes; in a relative world the vehicle has no place."""
    if sighting.relative:
        return NOWHERE
    if meeting.normal is LEVEL_NORMAL:
        return ALONG
    return (
        (1.0 - m[0] * d[0], -m[0] * d[1], -m[0] * d[2]),
        (-m[1] * d[0], 1.0 - m[1] * d[1], -m[1] * d[2]),
    )
