"""Whether a gimbal's reported roll and pitch count from the horizon or from the body, by the vehicle's motion. Pure.

The flags of a gimbal are a prior only: ArduPilot's servo mounts report servo angles, and say that they are locked to
the horizon. A gimbal holds its camera still while the vehicle moves. So the reading is right under which the camera's
tilt changes less: the reported one, or the reported one turned by the body. A camera that is not stabilised shows
nothing: a constant angle from the body looks like a camera that is held level. The horizon is therefore taken from the
motion only where the flags say so too.
"""

from __future__ import annotations

from math import exp, radians
from typing import Final, Literal

from fwav_companion.geometry.vectors import Vector3, norm, subtract

CLEAR_RATIO: Final = 4.0
"""Ratio of the variances of the tilt's steps at which one reading is right: a delay of 80 ms in an oscillation of
0.5 Hz leaves a sixteenth of the body's motion under the right one."""
NEEDED_MOTION: Final = radians(5.0)
"""Square root of the summed squares of the body's tilt steps that a decision needs: ten steps of 1.6 deg. The noise of
attitudes, 0.1 deg a step, is then a hundredth of it."""
NEEDED_STEPS: Final = 10
MEMORY_S: Final = 20.0
MOST_STEP_S: Final = 1.0


class HorizonEvidence:
    """Decides which reading of roll and pitch is right; it starts without a decision unless one is configured."""

    def __init__(self, configured: Literal["auto"] | bool = "auto") -> None:
        self._configured = configured
        self._last: tuple[int, Vector3, Vector3, Vector3] | None = None
        self._steps = 0
        self._level2 = self._body2 = self._motion2 = 0.0
        self._by_motion: bool | None = None

    def levelled(self, *, locked: bool, trusted: bool) -> bool | None:
        """Whether roll and pitch count from the horizon; None while both readings are possible.

        ``locked``: what the flags say. ``trusted``: whether the flags count until the motion contradicts them.
        """
        if self._configured != "auto":
            return self._configured
        if self._by_motion is not None and (locked or not self._by_motion):
            return self._by_motion
        return True if locked and trusted else None

    def forget_last(self) -> None:
        """Take no step from the last attitude to the next one: the gimbal or its clock started again."""
        self._last = None

    def add(self, at_ns: int, *, level_down: Vector3, body_down: Vector3, vehicle_down: Vector3) -> None:
        """Take one attitude: down in the camera's axes under both readings, and in the vehicle's."""
        last, self._last = self._last, (at_ns, level_down, body_down, vehicle_down)
        if last is None or not 0.0 < (elapsed_s := (at_ns - last[0]) * 1e-9) <= MOST_STEP_S:
            return
        keep = exp(-elapsed_s / MEMORY_S)
        level, body, motion = (
            norm(subtract(now, before)) ** 2
            for now, before in zip((level_down, body_down, vehicle_down), last[1:], strict=True)
        )
        self._steps += 1
        self._level2 = keep * self._level2 + level
        self._body2 = keep * self._body2 + body
        self._motion2 = keep * self._motion2 + motion
        if self._steps < NEEDED_STEPS or self._motion2 < NEEDED_MOTION**2:
            return
        if self._level2 > CLEAR_RATIO * self._body2:
            self._by_motion = False
        elif self._body2 > CLEAR_RATIO * self._level2:
            self._by_motion = True
