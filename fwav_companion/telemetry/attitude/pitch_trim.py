"""ArduPlane's PTCH_TRIM_DEG, which ArduPlane subtracts from the pitch in ATTITUDE, but not in other messages."""

from __future__ import annotations

from math import radians

MOST_TRIM_DEG = 60.0
"""Largest plausible trim, degrees. A larger value is not a trim of a vehicle that flies level."""
TRIM_STAYS = 1 << 8
"""FLIGHT_OPTIONS bit with which ATTITUDE keeps the trim and is the body's own attitude."""
MOST_OPTIONS = 2**31
VTOL_TYPES = frozenset(range(19, 26))
"""MAV_TYPEs of quadplanes. They may send their VTOL view instead, which has no trim, and do not report which view they
send."""


class PitchTrim:
    """Trim of the autopilot, read from its parameters; a vehicle without the parameter has no trim."""

    __slots__ = ("_deg", "_options", "_vtol", "correction", "correction_deg")

    def __init__(self) -> None:
        self._deg = 0.0
        self._options = 0
        self._vtol = False
        self.correction_deg = 0.0
        """Trim that is missing in the pitch of ATTITUDE, degrees."""
        self.correction = 0.0
        """Trim that is missing in the pitch of ATTITUDE, radians."""

    def _settle(self) -> None:
        self.correction_deg = 0.0 if self._vtol or self._options & TRIM_STAYS else self._deg
        self.correction = radians(self.correction_deg)

    def on_heartbeat(self, vehicle_type: int) -> None:
        """Take the vehicle type of a HEARTBEAT."""
        self._vtol = vehicle_type in VTOL_TYPES
        self._settle()

    def on_parameter(self, name: str, value: float) -> None:
        """Take a parameter of ArduPilot. The older name is in hundredths of a degree."""
        match name.rstrip("\0"):
            case "PTCH_TRIM_DEG" if abs(value) <= MOST_TRIM_DEG:
                self._deg = float(value)
            case "TRIM_PITCH_CD" if abs(value) <= 100.0 * MOST_TRIM_DEG:
                self._deg = float(value) / 100.0
            case "FLIGHT_OPTIONS" if 0.0 <= value < MOST_OPTIONS:
                self._options = int(value)
            case _:
                return
        self._settle()
