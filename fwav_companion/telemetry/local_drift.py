"""Drift of an autopilot's local position: a share of the way flown, for nothing pins such a position to the ground.

Optical flow errs by the scale of its height, visual odometry by that of its baseline: both by a share of the way, one
sigma of which is [vehicle] local_drift. It grows with the way and does not return, as an error that wanders would;
relative to the vehicle it cancels, as a receiver's does.
"""

from __future__ import annotations

from math import hypot

from fwav_companion.geometry.vectors import Vector3

LEAST_SIGMA_M = 0.05
"""One sigma before any way, metres: a hovering vehicle's estimate moves by centimetres."""
LEAST_STEP_M = 0.5
"""Distance from which the vehicle has moved, metres: the noise of shorter steps would add up to a way."""


class LocalDrift:
    """The way flown in the autopilot's local frame, and one sigma of its drift."""

    def __init__(self, share: float, base_m: float = LEAST_SIGMA_M) -> None:
        """``share``: one sigma of the drift over the way flown. ``base_m``: one sigma where the way begins."""
        self._share, self._base_m = share, base_m
        self._from: Vector3 | None = None
        self.way_m = 0.0

    def on_position(self, place: Vector3) -> None:
        """Take a position in the local frame."""
        if self._from is None:
            self._from = place
            return
        step_m = hypot(place[0] - self._from[0], place[1] - self._from[1])
        if step_m >= LEAST_STEP_M:
            self.way_m += step_m
            self._from = place

    @property
    def sigma_m(self) -> float:
        """One sigma of the position's slow error, metres an axis."""
        return hypot(self._base_m, self._share * self.way_m)
