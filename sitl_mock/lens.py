"""The paper's lens: r(theta) = k1 theta + k2 theta^3 + ... in millimetres, on a sensor of m pixels per millimetre."""

from __future__ import annotations

from math import atan2, hypot, inf, radians

from sitl_mock.options import CameraOptions
from sitl_mock.rotation import Vector

Pixel = tuple[float, float]
"""Pixel (u, v); the centre of the first pixel is (0, 0)."""


class Lens:
    """Lens and sensor: projects points to pixels. Pixel (0, 0) is the centre of the top-left pixel."""

    def __init__(self, options: CameraOptions) -> None:
        self._k = options.k_mm
        self._mu, self._mv = options.pixels_per_mm
        self._u0, self._v0 = options.principal_point
        self.width, self.height = options.image_size
        self._max_angle = radians(options.max_angle_deg)

    def pixel(self, point: Vector) -> Pixel:
        """Pixel (u, v) of a point in the camera frame (x right, y down, z forward); inf outside the lens's range."""
        x, y, z = point
        across = hypot(x, y)
        theta = atan2(across, z)
        if theta > self._max_angle:
            return (inf, inf)
        if across == 0.0:
            return (self._u0, self._v0)
        k1, k2, k3, k4, k5 = self._k
        t2 = theta * theta
        r = theta * (k1 + t2 * (k2 + t2 * (k3 + t2 * (k4 + t2 * k5))))
        return (self._u0 + self._mu * r * x / across, self._v0 + self._mv * r * y / across)

    def sees(self, u: float, v: float) -> bool:
        """Whether a pixel lies in the image."""
        return -0.5 <= u < self.width - 0.5 and -0.5 <= v < self.height - 0.5
