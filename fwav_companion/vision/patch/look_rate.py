"""The rate at which clicked spots are looked for: every picture where that costs a tenth of a core at most. PURE."""

from __future__ import annotations

from typing import Final

MOST_SHARE: Final = 0.1
"""Share of one core that looking for spots may take: the others, and the rest of this one, are for the flight."""
COST_SHARE: Final = 0.2
"""Share of a new measurement in the mean cost of a picture: five pictures."""
LEAST_HZ: Final = 2.0
"""Lowest rate: with fewer the place of a spot that moves through the picture in a second is no longer updated."""


class LookRate:
    """Decides for each picture whether the spots are looked for in it."""

    def __init__(self) -> None:
        self._cost_s = 0.0
        """Mean CPU time of a picture, seconds."""
        self._last_s: float | None = None

    @property
    def interval_s(self) -> float:
        """Shortest time between two pictures in which spots are looked for, seconds."""
        return min(self._cost_s / MOST_SHARE, 1.0 / LEAST_HZ)

    def is_due(self, now_s: float) -> bool:
        """Whether the spots are looked for in a picture that arrives now; then the interval begins."""
        due = self._last_s is None or now_s - self._last_s >= self.interval_s
        if due:
            self._last_s = now_s
        return due

    def spent(self, cpu_s: float) -> None:
        """Take the CPU time of one picture."""
        self._cost_s += COST_SHARE * (cpu_s - self._cost_s)
