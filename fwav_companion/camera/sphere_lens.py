"""A lens by a sphere model: the angle from the axis to a radius, then a plane with Brown-Conrady distortion.

    s = hypot(x, y),   theta = atan2(s, z),   m = m(theta) by the sphere model,   pixel = plane(m x / s, m y / s)

The plane is the pinhole of ``brown_conrady``: omni with radtan, double sphere and OCamCalib's affine map are one class.
"""

from __future__ import annotations

from math import atan2, cos, hypot, inf, pi, sin, tan

from fwav_companion.camera.brown_conrady import BrownConrady
from fwav_companion.camera.sphere_models import SphereModel, valid_angle
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types import NoRay, Ray

SLACK = 1e-9
"""Margin of the largest angle, radians: rays and pixels exactly on the edge are valid in both directions."""


class SphereLens:
    """An immutable lens whose rays go through a sphere onto a distorted plane."""

    __slots__ = ("_turn", "image_size", "largest_angle", "max_angle", "model", "plane")

    def __init__(self, model: SphereModel, plane: BrownConrady, *, roll: float = 0.0) -> None:
        """``roll``: turn of the plane's axes about the optical axis, radians: OCamCalib's affine map has one.

        The valid range ends at the first of: the farthest pixel of the image, the angle where the radius stops rising,
        and the plane's own range.
        """
        self.model = model
        self.plane = plane
        self.image_size = plane.image_size
        self._turn = (cos(roll), sin(roll))
        steady = valid_angle(model)
        reach, _ = model.radius_and_slope(steady)
        seen = tan(plane.max_angle)
        if seen < reach:
            steady = min(steady, model.angle(seen, steady))
        self.max_angle = steady
        self.largest_angle = min(steady + SLACK, pi)

    @property
    def principal_point(self) -> tuple[float, float]:
        """Pixel of the optical axis."""
        return self.plane.principal_point

    def camera_ray_from_pixel(self, u: float, v: float) -> Vector3 | NoRay:
        """The unit ray in the camera frame; NoRay beyond the valid range, and for a pixel that is not finite."""
        ray = self.camera_ray_and_derivatives_from_pixel(u, v)
        return ray if isinstance(ray, NoRay) else ray.direction

    def camera_ray_and_derivatives_from_pixel(self, u: float, v: float) -> Ray | NoRay:
        """The unit ray with its derivatives by u and v; NoRay beyond the valid range."""
        flat = self.plane.camera_ray_and_derivatives_from_pixel(u, v)
        if isinstance(flat, NoRay):
            return flat
        x, y, z = flat.direction
        x, y = x / z, y / z
        radius = hypot(x, y)
        if radius > self.model.radius_and_slope(self.max_angle)[0] * (1.0 + SLACK):
            return NoRay()
        theta = self.model.angle(radius, self.largest_angle)
        slope = self.model.radius_and_slope(theta)[1]
        if slope <= 0.0:
            return NoRay()
        cx, cy = (x / radius, y / radius) if radius > 0.0 else (1.0, 0.0)
        sine, cosine = sin(theta), cos(theta)
        across = sine / radius if radius > 0.0 else 1.0 / slope

        def turned(mx: float, my: float, down: float) -> Vector3:
            c, s = self._turn
            return (c * mx - s * my, s * mx + c * my, down)

        def derivative(d: Vector3) -> Vector3:
            dx, dy = (d[0] - x * d[2]) / z, (d[1] - y * d[2]) / z  # of the tangents x / z, y / z
            outward, sideways = cx * dx + cy * dy, cx * dy - cy * dx
            d_theta = outward / slope
            away, around = cosine * d_theta, across * sideways
            return turned(cx * away - cy * around, cy * away + cx * around, -sine * d_theta)

        return Ray(turned(cx * sine, cy * sine, cosine), derivative(flat.d_du), derivative(flat.d_dv))

    def pixel_from_camera_point(self, point: Vector3) -> tuple[float, float] | NoRay:
        """The pixel of a point at any distance; NoRay beyond the valid range, at the origin, and if not finite."""
        c, s = self._turn
        x, y, z = c * point[0] + s * point[1], c * point[1] - s * point[0], point[2]
        across = hypot(x, y)
        if not 0.0 < hypot(across, z) < inf:
            return NoRay()
        theta = atan2(across, z)
        if theta > self.largest_angle:
            return NoRay()
        radius, _ = self.model.radius_and_slope(min(theta, self.max_angle))
        share = radius / across if across > 0.0 else 0.0
        return self.plane.pixel_from_camera_point((share * x, share * y, 1.0))
