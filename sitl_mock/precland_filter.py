"""ArduPilot's estimate of a landing target (PLND_EST_TYPE 1): a filter for each axis, and its time line.

By `AP:libraries/AC_PrecLand/AC_PrecLand.cpp` run_estimator and `PosVelEKF.cpp`. The state is kept as a place and a
velocity over the ground, by the copter's own inertial position: the same as a vector that its motion predicts.
"""

from __future__ import annotations

from sitl_mock.patterns import Pair

FOUND_S, GAP_S, LOST_S = 2.0, 0.5, 2.0
"""Time from the first vector to its use, with gaps of at most GAP_S; time after the last one to the loss."""
ACCELERATION_M_S2, LOOP_HZ = 2.5, 400.0
"""PLND_ACC_P_NSE, in each loop."""
GATE, MOST_REJECTED = 3.0, 3
"""Normalised square beyond which a vector is rejected; after three in a row the fourth is taken."""
FIRST_SPEED_M_S = 2.0
"""One sigma of the first velocity, where the copter's own is known."""
FOUND, LOST = "PrecLand: Target Found", "PrecLand: Target Lost"


class Axis:
    """Kalman filter of one axis: place and velocity."""

    def __init__(self, place: float, variance: float) -> None:
        self.place, self.velocity = place, 0.0
        self._pp, self._pv, self._vv = variance, 0.0, FIRST_SPEED_M_S**2

    def predict(self, step_s: float) -> None:
        """Predicts over a step; the noise is that of the loops in it."""
        self.place += self.velocity * step_s
        self._pp += step_s * (2.0 * self._pv + step_s * self._vv)
        self._pv += step_s * self._vv
        self._vv += step_s * LOOP_HZ * (ACCELERATION_M_S2 / LOOP_HZ) ** 2

    def square(self, place: float, variance: float) -> float:
        """Normalised square of a measured place."""
        return (place - self.place) ** 2 / (self._pp + variance)

    def update(self, place: float, variance: float) -> None:
        """Takes a measured place."""
        total, off = self._pp + variance, place - self.place
        gain, gain_velocity = self._pp / total, self._pv / total
        self.place += gain * off
        self.velocity += gain_velocity * off
        self._vv -= gain_velocity * self._pv
        self._pv -= gain * self._pv
        self._pp -= gain * self._pp


class RelativeTarget:
    """The target over the ground, and whether it is followed."""

    def __init__(self) -> None:
        self._axes: tuple[Axis, Axis] | None = None
        self._begun_s = self._taken_s = self._now_s = 0.0
        self._stamp_ms: int | None = None
        self._rejected = 0
        self._acquired = False

    @property
    def followed(self) -> tuple[Pair, Pair] | None:
        """Place and velocity, north and east; None while it is not acquired."""
        if self._axes is None or not self._acquired:
            return None
        north, east = self._axes
        return (north.place, east.place), (north.velocity, east.velocity)

    def hear(self, place: Pair, down_m: float, stamp_ms: int, seen_s: float) -> bool:
        """Takes a place measured at an instant. False for a stamp that was taken already, and for a rejected one."""
        if stamp_ms == self._stamp_ms or down_m <= 0.0:
            return False
        self._stamp_ms = stamp_ms
        variance = (0.01 * down_m + 0.02) ** 2
        if self._axes is None:
            self._axes = (Axis(place[0], variance), Axis(place[1], variance))
            self._begun_s = self._taken_s = self._now_s
            return True
        since_s = max(0.0, self._now_s - seen_s)
        place = (place[0] + since_s * self._axes[0].velocity, place[1] + since_s * self._axes[1].velocity)
        beyond = any(axis.square(p, variance) > GATE for axis, p in zip(self._axes, place, strict=True))
        if beyond and self._rejected < MOST_REJECTED:
            self._rejected += 1
            return False
        for axis, p in zip(self._axes, place, strict=True):
            axis.update(p, variance)
        self._rejected, self._taken_s = 0, self._now_s
        return True

    def advance(self, now_s: float) -> list[str]:
        """Predicts to an instant; the texts for the pilot."""
        step_s, self._now_s = now_s - self._now_s, now_s
        if self._axes is None:
            return []
        for axis in self._axes:
            axis.predict(step_s)
        silent_s = now_s - self._taken_s
        if not self._acquired:
            if silent_s > GAP_S:
                self._axes = None
            elif now_s - self._begun_s > FOUND_S:
                self._acquired = True
                return [FOUND]
        elif silent_s > LOST_S:
            self._axes, self._acquired = None, False
            return [LOST]
        return []
