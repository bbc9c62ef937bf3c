"""The fisheye model of Kannala and Brandt (2006); by an exact map also OpenCV's, Kalibr's and ROS's equidistant model.

    theta = atan2(hypot(x, y), z)          from the optical axis; atan would mirror what lies beyond 90 degrees
    r(theta) = k1 theta + k2 theta^3 + k3 theta^5 + k4 theta^7 + k5 theta^9          millimetres on the sensor
    u = u0 + m_u (r cos(phi) + skew r sin(phi)),   v = v0 + m_v r sin(phi),   phi = atan2(y, x)

Only the products m k matter: two calibrations with different k1 can be the same lens.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, pi, sin, sqrt

from fwav_companion.camera.lens_numbers import require_lens_numbers
from fwav_companion.camera.radial_polynomial import (
    RayPiece,
    angle_from_radius,
    first_not_positive,
    radius_and_slope,
    ray_table,
)
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types import NoRay, Ray

LEAST_SLOPE = 1e-6
"""Ratio of r'(theta) to its value on the axis at which the valid range ends. Nearer to the fold (some 1e-6 rad) the
rounding of a pixel alone moves the angle by more than 1e-9 rad."""
SLACK = 1e-9
"""Margin of the largest angle, radians: rays and pixels exactly on the edge are valid in both directions."""


class KannalaBrandt:
    """An immutable lens whose image radius is an odd polynomial of the angle from the optical axis."""

    __slots__ = (
        "_table",
        "image_size",
        "k_mm",
        "largest_angle",
        "largest_radius",
        "max_angle",
        "pixels_per_mm",
        "principal_point",
        "ray_table",
        "skew",
    )

    def __init__(
        self,
        k_mm: Sequence[float],
        pixels_per_mm: tuple[float, float],
        principal_point: tuple[float, float],
        image_size: tuple[int, int],
        *,
        max_angle: float | None = None,
        skew: float = 0.0,
    ) -> None:
        """``max_angle``: configured limit, radians from the axis. ``skew``: OpenCV's alpha, K[0][1] / K[0][0].

        The valid range ends at the first of: ``max_angle``, the farthest corner of the image, the angle where r' stops
        being positive, and 180 degrees. ValueError names the number that no lens can have.
        """
        k1, k2, k3, k4, k5 = (*map(float, k_mm), *(0.0,) * (5 - len(k_mm)))
        self.k_mm = (k1, k2, k3, k4, k5)
        self.pixels_per_mm = pixels_per_mm
        self.principal_point = principal_point
        self.image_size = image_size
        self.skew = skew
        self._check(max_angle)
        self.max_angle = self._valid_range(inf if max_angle is None else max_angle)
        self.largest_angle = min(self.max_angle + SLACK, pi)
        self.largest_radius, _ = radius_and_slope(self.k_mm, self.largest_angle)
        self.ray_table = ray_table(self.k_mm, self.largest_angle)
        self._table = self._quick_table()

    def _check(self, max_angle: float | None) -> None:
        require_lens_numbers(
            positive=(self.k_mm[0], *self.pixels_per_mm, *self.image_size),
            other=(*self.k_mm, *self.principal_point, self.skew),
        )
        if max_angle is not None and not 0.0 < max_angle <= pi:
            raise ValueError("the largest angle must lie in (0°, 180°]")

    def _valid_range(self, configured: float) -> float:
        k = self.k_mm
        slope = (k[0] * (1.0 - LEAST_SLOPE), 3.0 * k[1], 5.0 * k[2], 7.0 * k[3], 9.0 * k[4])
        fold2 = first_not_positive(slope, pi * pi)
        steady = pi if fold2 is None else sqrt(fold2)
        corner = max(hypot(*self._sensor_from_pixel(u, v)) for u, v in self._corners())
        largest_radius, _ = radius_and_slope(k, steady)
        circle = angle_from_radius(k, corner, steady) if corner < largest_radius else inf
        return min(configured, circle, steady)

    def _quick_table(self) -> tuple[float, float, float, float, tuple[RayPiece, ...]]:
        """The numbers of the table look-up in one tuple. A skewed lens, which is rare, has no pieces and is solved."""
        table = self.ray_table
        (u0, v0), (m_u, m_v) = self.principal_point, self.pixels_per_mm
        pieces = table.pieces if self.skew == 0.0 else ()
        return (u0, v0, 1.0 / (m_u * table.unit), 1.0 / (m_v * table.unit), pieces)

    def _corners(self) -> tuple[tuple[float, float], ...]:
        right, bottom = self.image_size[0] - 0.5, self.image_size[1] - 0.5
        return ((-0.5, -0.5), (right, -0.5), (-0.5, bottom), (right, bottom))

    def _sensor_from_pixel(self, u: float, v: float) -> tuple[float, float]:
        y = (v - self.principal_point[1]) / self.pixels_per_mm[1]
        return (u - self.principal_point[0]) / self.pixels_per_mm[0] - self.skew * y, y

    def camera_ray_from_pixel(self, u: float, v: float) -> Vector3 | NoRay:
        """The unit ray in the camera frame; NoRay beyond the valid range, and for a pixel that is not finite."""
        u0, v0, per_u, per_v, pieces = self._table
        x = (u - u0) * per_u
        y = (v - v0) * per_v
        rho2 = x * x + y * y
        try:
            s0, s1, s2, s3, c0, c1, c2, c3 = pieces[int(rho2)]
        except (IndexError, ValueError, OverflowError):  # beyond the table, or not finite
            return self._solved_ray(u, v)
        s = s0 + rho2 * (s1 + rho2 * (s2 + rho2 * s3))
        return (x * s, y * s, c0 + rho2 * (c1 + rho2 * (c2 + rho2 * c3)))

    def _solved_ray(self, u: float, v: float) -> Vector3 | NoRay:
        """The unit ray by Newton's method where the table has no piece; NoRay beyond the valid range."""
        x, y = self._sensor_from_pixel(u, v)
        r = hypot(x, y)
        if not r <= self.largest_radius:
            return NoRay()
        if r == 0.0:
            return (0.0, 0.0, 1.0)
        theta = angle_from_radius(self.k_mm, r, self.largest_angle)
        s = sin(theta) / r
        return (x * s, y * s, cos(theta))

    def camera_ray_and_derivatives_from_pixel(self, u: float, v: float) -> Ray | NoRay:
        """The unit ray with its derivatives by u and v; NoRay beyond the valid range."""
        ray = self.camera_ray_from_pixel(u, v)
        if isinstance(ray, NoRay):
            return ray
        x, y = self._sensor_from_pixel(u, v)
        r, skew = hypot(x, y), self.skew
        mm_u, mm_v = 1.0 / self.pixels_per_mm[0], 1.0 / self.pixels_per_mm[1]
        if r == 0.0:
            per_mm = 1.0 / self.k_mm[0]
            return Ray(ray, (mm_u * per_mm, 0.0, 0.0), (-mm_v * skew * per_mm, mm_v * per_mm, 0.0))
        sine = hypot(ray[0], ray[1])
        _, slope = radius_and_slope(self.k_mm, atan2(sine, ray[2]))
        cx, cy = x / r, y / r
        across = sine / r
        bend = ray[2] / slope - across
        fall = -sine / slope
        by_x, by_both, by_y = across + bend * cx * cx, bend * cx * cy, across + bend * cy * cy
        return Ray(
            ray,
            (mm_u * by_x, mm_u * by_both, mm_u * fall * cx),
            (mm_v * (by_both - skew * by_x), mm_v * (by_y - skew * by_both), mm_v * fall * (cy - skew * cx)),
        )

    def pixel_from_camera_point(self, point: Vector3) -> tuple[float, float] | NoRay:
        """The pixel of a point at any distance; NoRay beyond the valid range, at the origin, and if not finite."""
        x, y, z = point
        across = hypot(x, y)
        if not 0.0 < hypot(across, z) < inf:
            return NoRay()
        theta = atan2(across, z)
        if theta > self.largest_angle:
            return NoRay()
        if across == 0.0:
            return self.principal_point if z > 0.0 else NoRay()
        r, _ = radius_and_slope(self.k_mm, theta)
        s = r / across
        (u0, v0), (m_u, m_v) = self.principal_point, self.pixels_per_mm
        return (u0 + m_u * s * (x + self.skew * y), v0 + m_v * s * y)
