"""Jumps of the autopilot's position beyond its velocity: its filter was reset to another solution."""

from __future__ import annotations

from math import hypot

from fwav_companion.geometry.stamps import NS_PER_S, BootNs
from fwav_companion.geometry.vectors import Vector3

LEAST_JUMP_M = 1.0
"""Least horizontal distance from the predicted position that is a jump, metres: a receiver's noise of 0.1 m is seven
sigma below it."""
LEAST_RESET_M = 0.1
"""The same where the autopilot says that its filter was reset, metres: a smaller step lies within the noise."""
MOST_ACCELERATION = 10.0
"""Largest acceleration of the vehicle, m/s^2: between two positions it moves the vehicle away from the mean of their
velocities by an eighth of the acceleration times the interval squared."""
LONGEST_S = 1.0
"""Longest interval between two compared positions, s: in a longer one the vehicle's own motion is unknown."""


class PositionJumps:
    """Compares each position with the one before it."""

    def __init__(self) -> None:
        self._last: tuple[BootNs, Vector3, Vector3] | None = None

    def on_position(
        self, boot_ns: BootNs, place_ned: Vector3, velocity_ned: Vector3, *, is_reset: bool = False
    ) -> tuple[float, float] | None:
        """The jump since the last position, north and east, metres; None without a jump. ``is_reset``: the autopilot
        says that its filter was reset since.
        """
        last, self._last = self._last, (boot_ns, place_ned, velocity_ned)
        if last is None or not 0 < boot_ns - last[0] <= LONGEST_S * NS_PER_S:
            return None
        step_s = (boot_ns - last[0]) / NS_PER_S
        north_m, east_m = (place_ned[k] - last[1][k] - 0.5 * (last[2][k] + velocity_ned[k]) * step_s for k in (0, 1))
        allowed_m = (LEAST_RESET_M if is_reset else LEAST_JUMP_M) + MOST_ACCELERATION * step_s * step_s / 8.0
        return (north_m, east_m) if hypot(north_m, east_m) > allowed_m else None
