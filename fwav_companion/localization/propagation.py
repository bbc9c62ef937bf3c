"""Derivatives of the ground point with respect to every error of a sighting: columns of its Jacobian.

The point is p = c + s d with the camera c, the distance s and the unit ray d. Let n be the ground's normal and
m = n / (n . d). A change x of the ray moves the point by s (x - (m . x) d), a change y of the camera by y - (m . y) d:
the second term is the way along the ray back to the surface. A small rotation w of the carrier changes the ray by
w x d, and the distance by the fraction w . (d x m). In numpy, with P = I - outer(d, m)::

    by_ray      = s * P                       # d(point)/d(ray)
    by_place    = P                           # d(point)/d(camera)
    by_rotation = s * P @ -skew(d)            # d(point)/d(rotation vector of the carrier, NED)
    time        = by_rotation @ ned_from_carrier @ rates + P @ velocity    # the latter as by the age of positions

tests/benchmarks/naive_fix.py has the whole fix in this form.

On level ground no error moves the point up or down. The columns are then exactly zero, not zero to rounding, because
filters use that.

Neglected: the camera turns with the vehicle about the vehicle's reference point. A lever of 0.3 m and 1 degree make
5 mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.rotations import body_axes_ned
from fwav_companion.geometry.vectors import (
    ZERO3,
    Vector3,
    add,
    combination,
    cross,
    dot,
    scale,
    subtract,
    transform,
)
from fwav_companion.localization.ground import LEVEL_NORMAL, Intersection
from fwav_companion.types import Sighting

Columns: TypeAlias = tuple[Vector3, ...]

NOWHERE: Columns = (ZERO3, ZERO3)
ALONG: Columns = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


class RangeSensitivity(msgspec.Struct, frozen=True, gc=False):
    """Relative change of the ray's length per unit of each error that turns the ray: the nonlinearity of the fix."""

    body: Vector3
    """Change per radian about the axes of the body, or of the gimbal that carries the camera."""
    heading: float
    """Change per radian about down."""
    pixel: tuple[float, float]
    """Change per pixel of u and of v."""
    time: float
    """Change per second."""


class Propagation(msgspec.Struct, frozen=True, gc=False):
    """Derivatives of the point, NED, with respect to every error: estimate minus truth per unit."""

    pixel_u: Vector3
    """d(point)/du, metres per pixel."""
    pixel_v: Vector3
    """d(point)/dv, metres per pixel."""
    biases: Columns
    """One column for each :class:`Bias`."""


def propagate(sighting: Sighting, direction: Vector3, meeting: Intersection) -> tuple[Propagation, RangeSensitivity]:
    """The derivatives of the intersection of the unit ray ``direction``, NED, with the ground, and of its length."""
    state, m = sighting.state, scale(meeting.normal, 1.0 / dot(meeting.normal, direction))
    x_axis, y_axis, z_axis = body_axes = body_axes_ned(state.ned_from_carrier)
    changes = (
        cross(x_axis, direction),
        cross(y_axis, direction),
        cross(z_axis, direction),
        (-direction[1], direction[0], 0.0),
        transform(sighting.ned_from_camera, sighting.ray.d_du),
        transform(sighting.ned_from_camera, sighting.ray.d_dv),
    )
    (roll, pitch, yaw, heading, pixel_u, pixel_v), stretch = _by_ray(changes, direction, meeting, m)
    # The true mount is Exp(bias) times the configured one, so the estimate turns the other way.
    mount_x, mount_y, mount_z = [(-north, -east, -down) for north, east, down in (roll, pitch, yaw)]
    deeper = scale(direction, m[2])  # d(point)/d(height of the camera above the ground)
    height = _by_height(sighting, meeting, deeper)
    lift = meeting.height_by_rotation
    # A beam on the body turns with the body, and the measured height changes; a gimbal's attitude does not turn it.
    if lift is not ZERO3 and state.gimbal is None:
        roll, pitch, yaw = (
            add(turn, scale(height, dot(axis, lift))) for turn, axis in zip((roll, pitch, yaw), body_axes, strict=True)
        )
        heading = add(heading, scale(height, lift[2]))
    lever_axes = body_axes if state.gimbal is None else body_axes_ned(state.ned_from_body)
    shifts = (scale(state.velocity_ned or ZERO3, -1.0), *lever_axes)  # an unknown velocity counts as zero
    position_delay, *levers = _by_camera(shifts, sighting, direction, meeting=meeting, m=m)
    time = subtract(combination((roll, pitch, yaw), state.carrier_rates), position_delay)
    north, east = _by_place(sighting, direction, meeting, m)
    terrain = scale(deeper, -1.0) if meeting.surveyed or meeting.uneven else ZERO3
    target_height = ZERO3 if sighting.anchor_sigma_m == 0.0 else _by_target_height(sighting, meeting, deeper)
    turning = (roll, pitch, heading, mount_x, mount_y, mount_z, time, scale(time, sighting.row_fraction))
    shifting = (height, north, east, terrain, position_delay, *levers, target_height)
    by_roll, by_pitch, by_yaw, by_heading, by_u, by_v = stretch
    by_body = (by_roll, by_pitch, by_yaw)
    by_time = dot(by_body, state.carrier_rates)
    return (
        Propagation(pixel_u, pixel_v, (*turning, *shifting)),
        RangeSensitivity(by_body, by_heading, (by_u, by_v), by_time),
    )


def _by_ray(changes: Columns, d: Vector3, meeting: Intersection, m: Vector3) -> tuple[Columns, Sequence[float]]:
    """The derivatives s P x along changes x of the ray, and the relative changes of its length.

    On level ground the down components are exactly zero.
    """
    (m_n, m_e, m_d), (d_n, d_e, d_d), s = m, d, meeting.distance_m
    columns, stretch, level = [], [], meeting.normal is LEVEL_NORMAL
    for n, e, down in changes:
        along = m_n * n + m_e * e + m_d * down
        columns.append((s * (n - along * d_n), s * (e - along * d_e), 0.0 if level else s * (down - along * d_d)))
        stretch.append(-along)
    return tuple(columns), stretch


def _by_camera(shifts: Columns, sighting: Sighting, d: Vector3, *, meeting: Intersection, m: Vector3) -> Columns:
    """The derivative of the point along each of these shifts of the camera, NED.

    In a relative world the horizontal axes move with the vehicle, and only the camera's height counts. Where the ground
    is known by its distance from the camera, it moves with the camera.
    """
    if sighting.relative:
        shifts = tuple([(0.0, 0.0, 0.0 if meeting.moves_with_camera else down) for _, _, down in shifts])
    if meeting.moves_with_camera:
        return shifts
    (m_n, m_e, m_d), (d_n, d_e, d_d), level = m, d, meeting.normal is LEVEL_NORMAL
    columns = []
    for north, east, down in shifts:
        along = m_n * north + m_e * east + m_d * down
        columns.append((north - along * d_n, east - along * d_e, 0.0 if level else down - along * d_d))
    return tuple(columns)


def _by_height(sighting: Sighting, meeting: Intersection, deeper: Vector3) -> Vector3:
    """The derivative of the point with respect to the camera's height above the ground.

    The point moves along the ray. Unless the ground is known by its distance from the camera, a height error is an
    error of the camera's altitude, so the camera itself is 1 m too high for each metre.
    """
    if meeting.moves_with_camera and not sighting.relative:
        return deeper
    return (deeper[0], deeper[1], 0.0 if meeting.normal is LEVEL_NORMAL else deeper[2] - 1.0)


def _by_target_height(sighting: Sighting, meeting: Intersection, deeper: Vector3) -> Vector3:
    """The derivative of the foot with respect to the height of the detected point above it, in that height's sigmas.

    A height that is 1 m too large lowers the camera by 1 m. The foot moves along the ground only.
    """
    down = 0.0 if meeting.normal is LEVEL_NORMAL else deeper[2] - 1.0
    return scale((deeper[0], deeper[1], down), -sighting.anchor_sigma_m)


def _by_place(sighting: Sighting, d: Vector3, meeting: Intersection, m: Vector3) -> Columns:
    """The derivatives P[:, :2] with respect to the vehicle's north and east position; zero in a relative world."""
    if sighting.relative:
        return NOWHERE
    if meeting.normal is LEVEL_NORMAL:
        return ALONG
    return (
        (1.0 - m[0] * d[0], -m[0] * d[1], -m[0] * d[2]),
        (-m[1] * d[0], 1.0 - m[1] * d[1], -m[1] * d[2]),
    )
