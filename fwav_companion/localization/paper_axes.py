"""The paper's own axes, and the only place that knows them.

The paper counts X forward, Y to the left, Z down: a left-handed frame, and with it its image is the mirror of a real
one. Its (x_c, y_c) are (forward, left), which are (-v, -u) of a real image whose top is the nose. Everything else here
is right-handed: camera x right, y down, z forward; body FRD; world NED.
"""

from __future__ import annotations

from math import cos, sin

from fwav_companion.geometry.vectors import Vector3


def camera_ray_from_paper(ray: Vector3) -> Vector3:
    """A ray (forward, left, along the axis) of the paper's camera in a real camera's axes."""
    forward, left, axis = ray
    return (-left, -forward, axis)


def paper_from_camera_ray(ray: Vector3) -> Vector3:
    """The inverse."""
    right, down, axis = ray
    return (-down, -right, axis)


def pixel_from_paper_pixel(
    u: float, v: float, principal_point: tuple[float, float], per_mm: tuple[float, float]
) -> tuple[float, float]:
    """Where a real camera sees what the paper's sees at (u, v)."""
    u0, v0 = principal_point
    forward_mm, left_mm = (u - u0) / per_mm[0], (v - v0) / per_mm[1]
    return (u0 - per_mm[0] * left_mm, v0 - per_mm[1] * forward_mm)


def ned_from_paper_point(forward_m: float, left_m: float, heading: float) -> tuple[float, float]:
    """(north, east) of the paper's (X_g, Y_g), for a vehicle that heads ``heading`` radians from north."""
    c, s = cos(heading), sin(heading)
    return (c * forward_m + s * left_m, s * forward_m - c * left_m)


def paper_point_from_ned(north_m: float, east_m: float, heading: float) -> tuple[float, float]:
    """The inverse: (X_g, Y_g), metres forward and to the left of the point below the camera."""
    c, s = cos(heading), sin(heading)
    return (c * north_m + s * east_m, s * north_m - c * east_m)
