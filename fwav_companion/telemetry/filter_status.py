"""Whether the autopilot's filter vouches for its local position, by EKF_STATUS_REPORT or ESTIMATOR_STATUS.

The two share their low flags and differ where it matters (ArduPilot `AP_NavEKF3_Outputs.cpp` getFilterStatus and
`ArduCopter/system.cpp` ekf_has_relative_position; PX4 `EKF/ekf_helper.cpp` get_ekf_soln_status):

- 1024 is "uninitialised" of ArduPilot, and a glitch of the receiver of PX4, which says nothing of a local position;
- newer PX4 sets CONSTANT_POSITION also for a vehicle at rest on the ground: it counts in the air alone;
- a disarmed ArduPilot flags what it predicts to have in flight, as its own arming check does.
"""

from __future__ import annotations

from typing import Any

ATTITUDE, VELOCITY_HORIZONTAL, VELOCITY_VERTICAL = 1, 2, 4
POSITION_RELATIVE, POSITION_ABSOLUTE, CONSTANT_POSITION = 8, 16, 128
PREDICTED_RELATIVE, PREDICTED_ABSOLUTE = 256, 512
ARDUPILOT_UNINITIALISED, PX4_ACCELERATION = 1024, 2048
REJECTED = 1.0
"""Ratio of innovation to gate at which the filter rejects its own measurements."""
LANDED_STATES_IN_THE_AIR = frozenset({2, 3, 4})
"""MAV_LANDED_STATE: in the air, taking off, landing."""


class FilterStatus:
    """Newest report of the autopilot's filter, and whether the vehicle is in the air."""

    def __init__(self) -> None:
        self._flags: int | None = None
        self._is_px4 = False
        self._ratios = (0.0, 0.0)
        self._armed = False
        self._landed_state: int | None = None

    def on_ardupilot_filter(self, fields: Any) -> None:
        """Take EKF_STATUS_REPORT."""
        self._flags, self._is_px4 = fields.flags, False
        self._ratios = (fields.velocity_variance, fields.pos_horiz_variance)

    def on_px4_filter(self, fields: Any) -> None:
        """Take ESTIMATOR_STATUS."""
        self._flags, self._is_px4 = fields.flags, True
        self._ratios = (fields.vel_ratio, fields.pos_horiz_ratio)

    def on_heartbeat(self, *, armed: bool) -> None:
        """Take whether the vehicle is armed."""
        self._armed = armed

    def on_landed_state(self, state: int) -> None:
        """Take EXTENDED_SYS_STATE.landed_state; 0: not known."""
        self._landed_state = state or None

    @property
    def local_trouble(self) -> str | None:
        """Why the local position is not good; "" where it is, None before the first report."""
        if self._flags is None:
            return None
        needed = self._missing()
        if needed:
            return needed
        velocity_ratio, position_ratio = self._ratios
        if not velocity_ratio < REJECTED:
            return "the filter rejects its velocity measurements"
        return "" if position_ratio < REJECTED else "the filter rejects its position measurements"

    def _missing(self) -> str:
        """The first flag that speaks against a local position, in words; "" for none."""
        flags = self._flags or 0
        if not self._is_px4 and flags & ARDUPILOT_UNINITIALISED:
            return "the filter has not started"
        if not flags & ATTITUDE:
            return "no attitude"
        if not self._is_px4 and not self._armed:
            expected = POSITION_RELATIVE | POSITION_ABSOLUTE | PREDICTED_RELATIVE | PREDICTED_ABSOLUTE
            return "" if flags & expected else "no horizontal position is expected in flight"
        if self._is_px4 and flags & PX4_ACCELERATION:
            return "bad accelerometer data"
        if flags & CONSTANT_POSITION and (not self._is_px4 or self._in_the_air):
            return "the filter holds a constant position: nothing measures horizontal motion"
        if not flags & VELOCITY_HORIZONTAL:
            return "no horizontal velocity"
        if self._is_px4 and not flags & VELOCITY_VERTICAL:
            return "no vertical velocity"
        return "" if flags & (POSITION_RELATIVE | POSITION_ABSOLUTE) else "no horizontal position"

    @property
    def _in_the_air(self) -> bool:
        """Whether the vehicle flies; where the autopilot does not say it, an armed one does."""
        return self._armed if self._landed_state is None else self._landed_state in LANDED_STATES_IN_THE_AIR
