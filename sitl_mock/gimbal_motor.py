"""The motors of a gimbal that obeys commands: each takes effect after a delay, and is reached at a limited rate."""

from __future__ import annotations

from bisect import bisect_right
from math import pi
from typing import NamedTuple

Look = tuple[float, float]
"""Pitch, and yaw from the vehicle's heading, radians."""
MOST_KEPT = 2000


class _Leg(NamedTuple):
    from_s: float
    start: Look
    goal: Look


class GimbalMotor:
    """Commanded motion; :attr:`moves` is False before the first command."""

    def __init__(self, delay_s: float, rate: float, *, frozen: bool) -> None:
        """``rate``: radians a second. ``frozen``: whether it takes commands and never moves."""
        self._delay_s, self._rate, self._frozen = delay_s, rate, frozen
        self._legs: list[_Leg] = []

    @property
    def moves(self) -> bool:
        """Whether a command was taken."""
        return bool(self._legs)

    def command(self, goal: Look, at_s: float, rests_at: Look) -> None:
        """Takes a command at an instant; ``rests_at``: where the gimbal looks before the first one."""
        if self._frozen:
            return
        effect_s = at_s + self._delay_s
        start = self.at(effect_s) if self._legs else rests_at
        self._legs.append(_Leg(effect_s, start, goal))
        del self._legs[:-MOST_KEPT]

    def at(self, t: float) -> Look:
        """Where it looks; before the oldest kept command, where that began."""
        index = bisect_right(self._legs, t, key=lambda leg: leg.from_s) - 1
        if index < 0:
            return self._legs[0].start
        leg = self._legs[index]
        most = self._rate * (t - leg.from_s)
        pitch = leg.start[0] + max(-most, min(most, leg.goal[0] - leg.start[0]))
        way = (leg.goal[1] - leg.start[1] + pi) % (2.0 * pi) - pi
        return pitch, leg.start[1] + max(-most, min(most, way))
