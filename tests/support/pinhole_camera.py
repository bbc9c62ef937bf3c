"""A pinhole camera that flies north at 5 m/s over flat ground, by its textbook formulas."""

from __future__ import annotations

from types import SimpleNamespace

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pairing import CameraView, Scaling
from fwav_companion.types import NoRay, Reason

FOCAL_PX = 500.0
LOOKS_DOWN = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""ned_from_camera: the image's top (-y) toward north, its right toward east."""
MS = 10**6


class Pinhole:
    """u = 320 + f x / z."""

    image_size = (640, 480)

    def pixel_from_camera_point(self, point):
        x, y, z = point
        return NoRay(Reason.OUTSIDE_LENS) if z <= 0.0 else (320.0 + FOCAL_PX * x / z, 240.0 + FOCAL_PX * y / z)


class Rows:
    """A frame whose rows are all captured at once."""

    def __init__(self, host_ns, scale=1.0):
        self.middle_ns, self.scaling = HostNs(host_ns), Scaling(scale, scale)

    def host_ns(self, _row):
        return self.middle_ns


class Camera:
    """Flies north at 5 m/s, 10 m high, looking down."""

    scale = 1.0

    def view_at(self, host_ns):
        return CameraView(Pinhole(), LOOKS_DOWN, (5e-9 * host_ns, 0.0, -10.0))

    def locate(self, u, v, _sigma_px, host_ns):
        north, east = 5e-9 * host_ns - (v - 240.0) / FOCAL_PX * 10.0, (u - 320.0) / FOCAL_PX * 10.0
        cov = ((0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 0.01))
        return SimpleNamespace(position_ned=(north, east, 0.0), relative_cov=cov)

    def picture_rows(self, frame):
        return Rows(frame.at, self.scale)
