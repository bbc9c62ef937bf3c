"""What ArduPlane takes off the pitch that ATTITUDE tells, and nowhere else: its PTCH_TRIM_DEG."""

from __future__ import annotations

from math import radians

MOST_TRIM_DEG = 60.0
"""More is no trim of anything that flies level: a parameter of that name that means something else."""
TRIM_STAYS = 1 << 8
"""FLIGHT_OPTIONS: ATTITUDE keeps the trim and is then the body's own."""
MOST_OPTIONS = 2**31
VTOL_TYPES = frozenset(range(19, 26))
"""A quadplane may send its view as a VTOL instead, which knows no trim: which of the two, it does not tell."""


class PitchTrim:
    """Known once the autopilot told its parameters; a vehicle without such a parameter has none."""

    __slots__ = ("_deg", "_options", "_vtol")

    def __init__(self) -> None:
        self._deg = 0.0
        self._options = 0
        self._vtol = False

    @property
    def taken_off_deg(self) -> float:
        """What is missing in the pitch of ATTITUDE."""
        return 0.0 if self._vtol or self._options & TRIM_STAYS else self._deg

    @property
    def taken_off(self) -> float:
        """The same in radians."""
        return radians(self.taken_off_deg)

    def on_heartbeat(self, vehicle_type: int) -> None:
        """The vehicle says what it is."""
        self._vtol = vehicle_type in VTOL_TYPES

    def on_parameter(self, name: str, value: float) -> None:
        """Of ArduPilot; hundredths of a degree by the older name."""
        match name.rstrip("\0"):
            case "PTCH_TRIM_DEG" if abs(value) <= MOST_TRIM_DEG:
                self._deg = float(value)
            case "TRIM_PITCH_CD" if abs(value) <= 100.0 * MOST_TRIM_DEG:
                self._deg = float(value) / 100.0
            case "FLIGHT_OPTIONS" if 0.0 <= value < MOST_OPTIONS:
                self._options = int(value)
            case _:
                pass
