"""The rate of searches for clicked spots: in every picture unless that costs more than a tenth of a core. PURE."""

from __future__ import annotations

from typing import Final

MOST_SHARE: Final = 0.1
"""Largest share of one core for the search: all other computing time is for the flight."""
COST_SHARE: Final = 0.2
"""Weight of a new measurement in the mean cost of a picture: time constant of five pictures."""
LEAST_HZ: Final = 2.0
"""Lowest rate: a lower one would not update the place of a spot that moves through the picture in a second."""


class LookRate:
    """Decides for each picture whether to search for the spots in it."""

    def __init__(self) -> None:
        self._cost_s = 0.0
        """Mean CPU time of a picture, seconds."""
        self._last_s: float | None = None

    @property
    def interval_s(self) -> float:
        """Shortest time between two searches for spots, seconds."""
        return min(self._cost_s / MOST_SHARE, 1.0 / LEAST_HZ)

    def is_due(self, now_s: float) -> bool:
        """Whether to search for the spots in a picture that arrives now; if so, a new interval begins."""
        due = self._last_s is None or now_s - self._last_s >= self.interval_s
        if due:
            self._last_s = now_s
        return due

    def spent(self, cpu_s: float) -> None:
        """Update the mean cost with the CPU time of one picture."""
        self._cost_s += COST_SHARE * (cpu_s - self._cost_s)
