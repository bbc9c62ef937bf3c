"""Motion of a vehicle held by hand: aperiodic swings, and quarter turns at intervals."""

from __future__ import annotations

from math import cos, pi, radians, sin, sqrt
from random import Random

from sitl_mock.options import FlightOptions

SLOWEST_HZ, FASTEST_HZ = 0.5, 1.7
"""Range of swing frequencies: an arm that shakes something it must not drop."""
SHARES = (1.0, 0.7, 0.5)
"""Relative amplitudes of the sines of one swing; their frequencies are incommensurate."""
TURN_S = 1.6
"""Duration of a quarter turn, seconds."""
STARTING_S = 1.0

AngleAndRate = tuple[float, float]


class Hand:
    """Roll, pitch and yaw added by the hand, with their rates, at any instant."""

    def __init__(self, options: FlightOptions, rng: Random) -> None:
        self._o = options
        size = sqrt(sum(share * share for share in SHARES))
        self._swings = [
            [
                (
                    radians(swing_deg) * share / size,
                    2.0 * pi * rng.uniform(SLOWEST_HZ, FASTEST_HZ),
                    rng.uniform(0, 2 * pi),
                )
                for share in SHARES
            ]
            for swing_deg in options.shake_deg
        ]

    def angles(self, t: float) -> tuple[AngleAndRate, AngleAndRate, AngleAndRate]:
        """(angle, rate) of roll, pitch and yaw."""
        roll, pitch, yaw = (self._swung(swing, t) for swing in self._swings)
        turn, turn_rate = self._turned(t)
        return roll, pitch, (yaw[0] + turn, yaw[1] + turn_rate)

    def share(self, t: float) -> AngleAndRate:
        """(fraction of the full shaking, its rate): 0 while the vehicle is held still."""
        if self._o.shake_from_s <= 0.0:
            return 1.0, 0.0
        return _eased(t - self._o.shake_from_s, STARTING_S)

    def _swung(self, swing: list[tuple[float, float, float]], t: float) -> AngleAndRate:
        angle = sum(size * sin(w * t + phase) for size, w, phase in swing)
        rate = sum(size * w * cos(w * t + phase) for size, w, phase in swing)
        share, share_rate = self.share(t)
        return share * angle, share * rate + share_rate * angle

    def _turned(self, t: float) -> AngleAndRate:
        """(angle, rate) of the quarter turns: one way after the first pause, back after the next."""
        since_s, pause_s = t - self._o.shake_from_s, self._o.quarter_turn_s
        if pause_s <= 0.0 or since_s < pause_s:
            return 0.0, 0.0
        turns, in_pause_s = divmod(since_s, pause_s)
        done, rate = _eased(in_pause_s, TURN_S)
        back = int(turns) % 2 == 0
        return 0.5 * pi * (1.0 - done if back else done), 0.5 * pi * (-rate if back else rate)


def _eased(since_s: float, lasts_s: float) -> AngleAndRate:
    """Smooth step from 0 to 1 without a jump in rate, and its rate."""
    x = min(1.0, max(0.0, since_s / lasts_s))
    return x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / lasts_s
