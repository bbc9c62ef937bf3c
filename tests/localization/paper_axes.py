"""The paper's own axes, and the only file that knows them.

The paper counts X forward, Y to the left, Z down: a left-handed frame, in which its image is the mirror image of a real
one. Its (x_c, y_c) are (forward, left), which are (-v, -u) of a real image whose top is the nose. The package is
right-handed throughout: camera x right, y down, z forward; body FRD; world NED.
"""

from __future__ import annotations

from math import cos, sin

Vector3 = tuple[float, float, float]


def camera_ray_from_paper(ray: Vector3) -> Vector3:
    """A ray (forward, left, along the axis) of the paper's camera in the axes of a real camera."""
    forward, left, axis = ray
    return (-left, -forward, axis)


def paper_from_camera_ray(ray: Vector3) -> Vector3:
    """The inverse."""
    right, down, axis = ray
    return (-down, -right, axis)


def pixel_from_paper_pixel(
    u: float, v: float, principal_point: tuple[float, float], per_mm: tuple[float, float]
) -> tuple[float, float]:
    """The pixel of a real camera for the pixel (u, v) of the paper's camera."""
    u0, v0 = principal_point
    forward_mm, left_mm = (u - u0) / per_mm[0], (v - v0) / per_mm[1]
    return (u0 - per_mm[0] * left_mm, v0 - per_mm[1] * forward_mm)


def ned_from_paper_point(forward_m: float, left_m: float, heading: float) -> tuple[float, float]:
    """(north, east) of the paper's (X_g, Y_g) for a vehicle with this heading from north, radians."""
    c, s = cos(heading), sin(heading)
    return (c * forward_m + s * left_m, s * forward_m - c * left_m)


def paper_point_from_ned(north_m: float, east_m: float, heading: float) -> tuple[float, float]:
    """The inverse: (X_g, Y_g), metres forward and to the left of the point below the camera."""
    c, s = cos(heading), sin(heading)
    return (c * north_m + s * east_m, s * north_m - c * east_m)
