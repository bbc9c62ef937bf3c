"""The pinhole with Brown-Conrady distortion (Brown 1966): ROS's and OpenCV's plumb_bob and rational_polynomial.

    x = X/Z,  y = Y/Z,  q = x^2 + y^2,  g = (1 + k1 q + k2 q^2 + k3 q^3) / (1 + k4 q + k5 q^2 + k6 q^3)
    x' = g x + 2 p1 x y + p2 (q + 2 x^2),   y' = g y + p1 (q + 2 y^2) + 2 p2 x y
    u = fx (x' + skew y') + cx,   v = fy y' + cy

Such a polynomial folds back on itself at some angle. A pixel then has two rays; only the one inside the fold is true.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan, cos, hypot, inf, pi, radians, sin, sqrt, tan
from typing import TypeAlias

from fwav_companion.camera.lens_numbers import require_lens_numbers
from fwav_companion.geometry.vectors import Vector3, add, scale
from fwav_companion.types import NoRay, Ray

Jacobian: TypeAlias = tuple[float, float, float, float]
"""Derivatives dx'/dx, dx'/dy, dy'/dx, dy'/dy."""
Trial: TypeAlias = tuple[float, float, float, tuple[float, float], Jacobian]
"""Tangents x and y, the residual's length, the residual, and the Jacobian at (x, y)."""

MOST_STEPS = 60
STEEPEST_ANGLE = radians(89.0)
"""Limit of the valid range, radians: a pinhole ends before 90 deg; at 89 deg and f = 1000 px a pixel is 2e-5 deg."""
FOLD_STEPS, FOLD_DIRECTIONS = 178, 16
"""The search for the fold tests every half degree in 16 directions: tangential terms are small and smooth."""
LEAST_DETERMINANT = 1e-6
"""Determinant at which the valid range ends. Nearer to the fold the rounding of a pixel alone moves the ray by more
than 1e-9 rad."""
BORDER_SAMPLES = 8
"""Pixels tested on each side of the image in the search for the pixel that is farthest from the axis."""
SLACK = 1e-9
"""Relative margin of the largest radius: rays and pixels exactly on the edge are valid in both directions."""


class BrownConrady:
    """An immutable pinhole lens with radial and tangential distortion."""

    __slots__ = ("distortion", "focal", "image_size", "largest_tangent", "max_angle", "principal_point", "skew")

    def __init__(
        self,
        focal: tuple[float, float],
        principal_point: tuple[float, float],
        distortion: Sequence[float],
        image_size: tuple[int, int],
        *,
        max_angle: float | None = None,
        skew: float = 0.0,
    ) -> None:
        """``distortion``: k1, k2, p1, p2[, k3[, k4, k5, k6]], as OpenCV orders them. ``skew``: K[0][1] / K[0][0].

        The valid range ends at the first of: ``max_angle`` (radians), the farthest pixel of the image, the fold, and
        89 degrees. ValueError names the number that no lens can have.
        """
        k1, k2, p1, p2, k3, k4, k5, k6 = (*map(float, distortion), *(0.0,) * (8 - len(distortion)))
        self.focal = focal
        self.principal_point = principal_point
        self.distortion = (k1, k2, p1, p2, k3, k4, k5, k6)
        self.image_size = image_size
        self.skew = skew
        require_lens_numbers(positive=(*focal, *image_size), other=(*self.distortion, *principal_point, skew))
        if max_angle is not None and not 0.0 < max_angle <= pi:
            raise ValueError("the largest angle must lie in (0°, 180°]")
        self.largest_tangent = tan(min(STEEPEST_ANGLE, inf if max_angle is None else max_angle, self._fold()))
        self.max_angle = min(atan(self.largest_tangent), self._image_circle())
        self.largest_tangent = tan(self.max_angle) * (1.0 + SLACK)

    def _fold(self) -> float:
        """The smallest angle from the axis where the distortion stops being one to one, radians."""
        if not any(self.distortion):
            return STEEPEST_ANGLE
        return min(self._fold_along(2.0 * pi * i / FOLD_DIRECTIONS) for i in range(FOLD_DIRECTIONS))

    def _fold_along(self, direction: float) -> float:
        def is_steady(angle: float) -> bool:
            r = tan(angle)
            _, (a, b, c, d) = self._distorted(r * cos(direction), r * sin(direction))
            return a * d - b * c > LEAST_DETERMINANT and a + d > 0.0

        low = 0.0
        for i in range(1, FOLD_STEPS + 1):
            high = STEEPEST_ANGLE * i / FOLD_STEPS
            if not is_steady(high):
                break
            low = high
        else:
            return STEEPEST_ANGLE
        for _ in range(50):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if is_steady(middle) else (low, middle)
        return low

    def _image_circle(self) -> float:
        """The largest angle of any pixel on the image's border, radians; infinite if one of them has no ray."""
        largest = 0.0
        width, height = self.image_size
        for i in range(BORDER_SAMPLES + 1):
            u, v = width * i / BORDER_SAMPLES - 0.5, height * i / BORDER_SAMPLES - 0.5
            for pixel in ((u, -0.5), (u, height - 0.5), (-0.5, v), (width - 0.5, v)):
                tangents = self._tangents_from_pixel(*pixel)
                if isinstance(tangents, NoRay):
                    return inf
                largest = max(largest, atan(hypot(*tangents)))
        return largest

    def _distorted(self, x: float, y: float) -> tuple[tuple[float, float], Jacobian]:
        k1, k2, p1, p2, k3, k4, k5, k6 = self.distortion
        q = x * x + y * y
        above = 1.0 + q * (k1 + q * (k2 + q * k3))
        below = 1.0 + q * (k4 + q * (k5 + q * k6))
        if below <= 0.0:  # beyond a pole the map is not one to one
            return (inf, inf), (0.0, 0.0, 0.0, 0.0)
        g = above / below
        g_q = (k1 + q * (2.0 * k2 + q * 3.0 * k3) - g * (k4 + q * (2.0 * k5 + q * 3.0 * k6))) / below
        xy, both = 2.0 * x * y, 2.0 * (p1 * x + p2 * y)
        cross = g_q * xy + both
        return (
            (g * x + p1 * xy + p2 * (q + 2.0 * x * x), g * y + p1 * (q + 2.0 * y * y) + p2 * xy),
            (
                g + 2.0 * g_q * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
                cross,
                cross,
                g + 2.0 * g_q * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
            ),
        )

    def _tangents_from_pixel(self, u: float, v: float) -> tuple[float, float] | NoRay:
        """The tangents (X/Z, Y/Z) of a pixel, by a damped Newton iteration; NoRay beyond the valid range."""
        goal_y = (v - self.principal_point[1]) / self.focal[1]
        goal_x = (u - self.principal_point[0]) / self.focal[0] - self.skew * goal_y
        radius = hypot(goal_x, goal_y)
        if not radius < inf:
            return NoRay()
        shrink = 0.5 * self.largest_tangent / radius if radius > 0.5 * self.largest_tangent else 1.0
        trial = self._trial(goal_x, goal_y, goal_x * shrink, goal_y * shrink)
        for _ in range(MOST_STEPS):
            following = self._closer(goal_x, goal_y, trial)
            if following is None:
                break
            trial = following
        x, y, error, _, _ = trial
        if error > 1e-13 * (1.0 + radius) or hypot(x, y) > self.largest_tangent:
            return NoRay()
        return x, y

    def _trial(self, goal_x: float, goal_y: float, x: float, y: float) -> Trial:
        (at_x, at_y), jacobian = self._distorted(x, y)
        missing = (goal_x - at_x, goal_y - at_y)
        return (x, y, hypot(*missing), missing, jacobian)

    def _closer(self, goal_x: float, goal_y: float, trial: Trial) -> Trial | None:
        """The Newton step, halved until the residual falls and the point is inside the fold; None if no step does."""
        x, y, error, (miss_x, miss_y), (a, b, c, d) = trial
        determinant = a * d - b * c
        if determinant <= 0.0 or error == 0.0:
            return None
        dx, dy = (d * miss_x - b * miss_y) / determinant, (a * miss_y - c * miss_x) / determinant
        for part in (1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125):
            tried = self._trial(goal_x, goal_y, x + part * dx, y + part * dy)
            _, _, tried_error, _, (a, b, c, d) = tried
            if tried_error < error and a * d > b * c:
                return tried
        return None

    def camera_ray_from_pixel(self, u: float, v: float) -> Vector3 | NoRay:
        """The unit ray in the camera frame; NoRay beyond the valid range, and for a pixel that is not finite."""
        tangents = self._tangents_from_pixel(u, v)
        if isinstance(tangents, NoRay):
            return tangents
        x, y = tangents
        n = 1.0 / sqrt(1.0 + x * x + y * y)
        return (x * n, y * n, n)

    def camera_ray_and_derivatives_from_pixel(self, u: float, v: float) -> Ray | NoRay:
        """The unit ray with its derivatives by u and v; NoRay beyond the valid range."""
        tangents = self._tangents_from_pixel(u, v)
        if isinstance(tangents, NoRay):
            return tangents
        x, y = tangents
        n = 1.0 / sqrt(1.0 + x * x + y * y)
        d_dx = (n - x * x * n**3, -x * y * n**3, -x * n**3)
        d_dy = (-x * y * n**3, n - y * y * n**3, -y * n**3)
        _, (a, b, c, d) = self._distorted(x, y)
        per_u = 1.0 / (self.focal[0] * (a * d - b * c))
        per_v = 1.0 / (self.focal[1] * (a * d - b * c))
        d_du = add(scale(d_dx, per_u * d), scale(d_dy, -per_u * c))
        s = self.skew
        d_dv = add(scale(d_dx, per_v * (-b - s * d)), scale(d_dy, per_v * (a + s * c)))
        return Ray((x * n, y * n, n), d_du, d_dv)

    def pixel_from_camera_point(self, point: Vector3) -> tuple[float, float] | NoRay:
        """The pixel of a point at any distance; NoRay beyond the valid range, and if the point is not finite."""
        x, y, z = point
        if not (0.0 < z < inf and hypot(x, y) <= self.largest_tangent * z):
            return NoRay()
        (x, y), _ = self._distorted(x / z, y / z)
        return (
            self.principal_point[0] + self.focal[0] * (x + self.skew * y),
            self.principal_point[1] + self.focal[1] * y,
        )
