"""One sigma of the vehicle's horizontal position error, as the receiver and the autopilot's filter report it.

An RTK receiver with a fixed solution is accurate to 0.02 m, with a float solution to 0.3 m; for any other, 1 m is
assumed. A larger ``h_acc`` replaces these values, a smaller one does not: receivers without corrections report less
than they wander. The autopilot's filter must use the receiver: where EKF_STATUS_REPORT or ESTIMATOR_STATUS report that
it does not, the position is not the receiver's.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

RTK_SIGMA_M = {6: 0.02, 5: 0.3}
"""One sigma by GPS_FIX_TYPE, metres: RTK fixed and RTK float."""
USUAL_SIGMA_M = 1.0
STEPS_M = (0.02, 0.05, 0.1, 0.3, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
"""Values to which an accuracy is rounded up, metres: it changes with every message, but the sigma in a track must
not."""
UNKNOWN_ACCURACY = 0xFFFFFFFF
MM_PER_M = 1000.0
POSITION_ABSOLUTE, CONSTANT_POSITION = 16, 128
"""Flags of EKF_STATUS_REPORT and ESTIMATOR_STATUS alike."""
ARDUPILOT_GLITCH, PX4_GLITCH = 32768, 1024
REJECTED = 1.0
"""Ratio of innovation to gate at which the autopilot's filter rejects the receiver."""


class PositionBias:
    """Position accuracy from the newest reports of receiver and filter."""

    def __init__(self) -> None:
        self._receiver_m: float | None = None
        self._filter_m = 0.0

    @property
    def sigma_m(self) -> float | None:
        """One sigma, metres an axis; None before the receiver's first report."""
        return None if self._receiver_m is None else max(self._receiver_m, self._filter_m)

    def on_gps(self, fields: Any) -> None:
        """Take GPS_RAW_INT; an accuracy of 0 means an absent extension."""
        claimed = 0.0 if fields.h_acc == UNKNOWN_ACCURACY else fields.h_acc / MM_PER_M
        self._receiver_m = max(RTK_SIGMA_M.get(fields.fix_type, USUAL_SIGMA_M), _step(claimed))

    def on_ardupilot_filter(self, fields: Any) -> None:
        """Take EKF_STATUS_REPORT."""
        bad = _is_bad(fields.flags, ARDUPILOT_GLITCH) or not fields.pos_horiz_variance < REJECTED
        self._filter_m = USUAL_SIGMA_M if bad else 0.0

    def on_px4_filter(self, fields: Any) -> None:
        """Take ESTIMATOR_STATUS; its accuracy is used only where it is worse than a receiver's without corrections."""
        bad = _is_bad(fields.flags, PX4_GLITCH) or not fields.pos_horiz_ratio < REJECTED
        own_m = float(fields.pos_horiz_accuracy)
        worse = isfinite(own_m) and own_m > USUAL_SIGMA_M
        self._filter_m = _step(own_m) if worse else USUAL_SIGMA_M if bad else 0.0


def _is_bad(flags: int, glitch: int) -> bool:
    return not flags & POSITION_ABSOLUTE or bool(flags & (CONSTANT_POSITION | glitch))


def _step(sigma_m: float) -> float:
    return next((step for step in STEPS_M if sigma_m <= step), STEPS_M[-1])
