"""Variety of the views of the targets: what separates a mount from a place."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, sin

import msgspec

from fwav_companion.geometry.rotations import conjugate, euler_from_quaternion, rotate
from fwav_companion.geometry.vectors import Vector3, add, scale, subtract
from fwav_companion.types import GroundFix

LEAST_TURN = 0.9
"""Mean resultant length of the headings: above, the vehicle looked from one side only (26 deg of spread)."""
LEAST_SWING_RAD = 0.17
"""Spread of the angle off the nadir that shows the mount without any turn."""


class ViewGeometry(msgspec.Struct, frozen=True, gc=False):
    """Sums over measurements: headings, angles off the nadir, down axes."""

    count: int = 0
    cos: float = 0.0
    sin: float = 0.0
    off: float = 0.0
    off2: float = 0.0
    downs: Vector3 = (0.0, 0.0, 0.0)
    """Sum of the down axes in the carrier of the camera."""

    def with_fixes(self, fixes: Sequence[GroundFix]) -> ViewGeometry:
        """The sums after the fixes of one more frame."""
        state, count = fixes[0].sighting.state, len(fixes)
        _, _, yaw = euler_from_quaternion(state.ned_from_body)
        off = off2 = 0.0
        for fix in fixes:
            north, east, down = subtract(fix.position_ned, fix.sighting.camera_ned)
            angle = atan2(hypot(north, east), down)
            off, off2 = off + angle, off2 + angle * angle
        down_axis = rotate(conjugate(state.ned_from_carrier), (0.0, 0.0, float(count)))
        return ViewGeometry(
            self.count + count,
            self.cos + count * cos(yaw),
            self.sin + count * sin(yaw),
            self.off + off,
            self.off2 + off2,
            add(self.downs, down_axis),
        )

    @property
    def down(self) -> Vector3:
        """Mean down axis in the carrier of the camera."""
        return scale(self.downs, 1.0 / self.count) if self.count else (0.0, 0.0, 1.0)

    @property
    def various(self) -> bool:
        """Whether the views came from different headings, or at different ranges."""
        if not self.count:
            return False
        turn = hypot(self.cos, self.sin) / self.count
        swing2 = self.off2 / self.count - (self.off / self.count) ** 2
        return turn < LEAST_TURN or swing2 > LEAST_SWING_RAD**2
