"""How differently the targets were looked at: what a flight must offer before a mount can be told from a place."""

from __future__ import annotations

from math import acos, cos, hypot, sin

import msgspec

from fwav_companion.geometry.rotations import conjugate, euler_from_quaternion, rotate
from fwav_companion.geometry.vectors import Vector3, add, scale, transform
from fwav_companion.types import GroundFix

LEAST_TURN = 0.9
"""Mean resultant length of the headings: above, the vehicle has looked from one side only (26 deg of spread)."""
LEAST_SWING_RAD = 0.17
"""Spread of the angle off the nadir that shows the mount without any turn."""


class ViewGeometry(msgspec.Struct, frozen=True, gc=False):
    """How differently the targets were looked at: sums over glimpses."""

    count: int = 0
    cos: float = 0.0
    sin: float = 0.0
    off: float = 0.0
    off2: float = 0.0
    downs: Vector3 = (0.0, 0.0, 0.0)
    """Of down in what carries the camera."""

    def with_fix(self, fix: GroundFix) -> ViewGeometry:
        """With one more look."""
        _, _, yaw = euler_from_quaternion(fix.sighting.state.ned_from_body)
        ray = transform(fix.sighting.ned_from_camera, fix.sighting.ray.direction)
        off = acos(max(-1.0, min(1.0, ray[2])))
        down = rotate(conjugate(fix.sighting.state.ned_from_carrier), (0.0, 0.0, 1.0))
        return ViewGeometry(
            self.count + 1,
            self.cos + cos(yaw),
            self.sin + sin(yaw),
            self.off + off,
            self.off2 + off * off,
            add(self.downs, down),
        )

    @property
    def down(self) -> Vector3:
        """In what carries the camera, on the average."""
        return scale(self.downs, 1.0 / self.count) if self.count else (0.0, 0.0, 1.0)

    @property
    def various(self) -> bool:
        """From different headings, or at different ranges."""
        if not self.count:
            return False
        turn = hypot(self.cos, self.sin) / self.count
        swing2 = self.off2 / self.count - (self.off / self.count) ** 2
        return turn < LEAST_TURN or swing2 > LEAST_SWING_RAD**2
