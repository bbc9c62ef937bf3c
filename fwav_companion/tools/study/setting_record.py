"""A recorded flight under one setting: its measures, or why it could not be replayed. PURE."""

from __future__ import annotations

from typing import Final

import msgspec

AS_RECORDED: Final = 0
"""Number of the setting that changes nothing."""


class Measure(msgspec.Struct, frozen=True):
    """A quantity by which settings are compared; nearer to ``ideal`` is better."""

    field: str
    name: str
    unit: str
    """"m" for lengths, "" for numbers, "%" for shares."""
    ideal: float = 0.0

    def distance(self, value: float) -> float:
        """Distance of a value from the ideal one."""
        return abs(value - self.ideal)


MEASURES: Final = (
    Measure("error_m", "error at the end (truth.csv)", "m"),
    Measure("radius95_m", "claimed radius (95 %) at the end", "m"),
    Measure("scatter_m", "scatter of fixes about their track", "m"),
    Measure("nis", "normalised squares of the innovations (2 is right)", "", 2.0),
    Measure("unanswered", "share without an answer", "%"),
)


class SettingRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One flight under one setting. A measure is None where the flight does not have it."""

    flight: str
    setting: int
    """AS_RECORDED, or the number of the setting, from 1."""
    damage: str = ""
    """Why the flight could not be replayed."""
    error_m: float | None = None
    """Median over the true targets that were found of their horizontal errors at the end."""
    radius95_m: float | None = None
    """Median over confirmed targets of the larger semi-axis of their last 95 % ellipse."""
    scatter_m: float | None = None
    """Root mean square distance of fixes from their confirmed track."""
    nis: float | None = None
    """Mean normalised innovation squared of confirmed tracks."""
    unanswered: float | None = None
    """Share of true targets that were not found; if the truth is unknown, the share of detections without a fix."""
