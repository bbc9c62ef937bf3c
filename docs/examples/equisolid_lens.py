"""A lens model of one's own: the equisolid-angle fisheye, r = 2 f sin(theta / 2).

It follows the protocol ``fwav_companion.types.Lens``. One line in ``fwav_companion/camera/calibration.py`` is enough::

    LENS_READERS["equisolid"] = read_equisolid

A camera file then names it: ``model: equisolid``, ``image_size``, ``focal_px``, ``principal_point``.
"""

from __future__ import annotations

from math import asin, atan2, cos, hypot, inf, pi, radians, sin, sqrt

from fwav_companion.camera.fields import Fields
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types import NoRay, Ray

STEEPEST = radians(179.0)
"""Limit of the valid range, radians: at 180 degrees the radius no longer grows with the angle."""
SLACK = 1e-9
"""Margin of the largest angle, radians: rays and pixels exactly on the edge are valid in both directions."""


class EquisolidLens:
    """An immutable lens; the ray and the pixel have the same range of validity."""

    def __init__(self, focal_px: float, principal_point: tuple[float, float], image_size: tuple[int, int]) -> None:
        self.focal_px, self.principal_point, self.image_size = focal_px, principal_point, image_size
        (u0, v0), (width, height) = principal_point, image_size
        corner = hypot(max(u0 + 0.5, width - 0.5 - u0), max(v0 + 0.5, height - 0.5 - v0))
        half_sine = corner / (2.0 * focal_px)
        self.max_angle = min(STEEPEST, 2.0 * asin(half_sine) if half_sine < 1.0 else pi)
        """The farthest corner of the image, or the limit of the model."""

    def pixel_from_camera_point(self, point: Vector3) -> tuple[float, float] | NoRay:
        """The pixel of a point at any distance; NoRay beyond the valid range, at the origin, and if not finite."""
        x, y, z = point
        across = hypot(x, y)
        if not 0.0 < hypot(across, z) < inf:
            return NoRay()
        theta = atan2(across, z)
        if theta > self.max_angle + SLACK:
            return NoRay()
        per_m = 2.0 * self.focal_px * sin(0.5 * theta) / across if across > 0.0 else 0.0
        return (self.principal_point[0] + per_m * x, self.principal_point[1] + per_m * y)

    def camera_ray_from_pixel(self, u: float, v: float) -> Vector3 | NoRay:
        """The unit ray of a pixel; NoRay beyond the valid range."""
        ray = self.camera_ray_and_derivatives_from_pixel(u, v)
        return ray if isinstance(ray, NoRay) else ray.direction

    def camera_ray_and_derivatives_from_pixel(self, u: float, v: float) -> Ray | NoRay:
        """The unit ray with its derivatives.

        With (a, b) the pixel from the centre over f, and s = a^2 + b^2 = 4 sin^2(theta / 2): the ray is
        (a w, b w, 1 - s / 2) with w = sqrt(1 - s / 4), since sin(theta) = 2 sin(theta / 2) cos(theta / 2).
        """
        a, b = (u - self.principal_point[0]) / self.focal_px, (v - self.principal_point[1]) / self.focal_px
        s = a * a + b * b
        if not s <= (2.0 * sin(0.5 * (self.max_angle + SLACK))) ** 2:
            return NoRay()
        w, f = sqrt(1.0 - 0.25 * s), self.focal_px
        bend = -0.25 / w  # dw/da = bend a
        return Ray(
            (a * w, b * w, 1.0 - 0.5 * s),
            ((w + bend * a * a) / f, bend * a * b / f, -a / f),
            (bend * a * b / f, (w + bend * b * b) / f, -b / f),
        )


def read_equisolid(fields: Fields) -> EquisolidLens:
    """The lens of a camera file. A wrong key is one line that names the file, the key and what is accepted."""
    u0, v0 = fields.numbers("principal_point", 2)
    return EquisolidLens(fields.positive("focal_px"), (u0, v0), fields.size("image_size"))


if __name__ == "__main__":
    lens = EquisolidLens(300.0, (319.5, 239.5), (640, 480))
    for degrees in range(0, 70, 10):
        print(degrees, lens.pixel_from_camera_point((sin(radians(degrees)), 0.0, cos(radians(degrees)))))  # noqa: T201
