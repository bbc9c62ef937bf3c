"""When each row of an image was exposed.

The capture of row v is ``stamp - time_offset_s + m + readout_s * v / height``, with m by what the stamp marks; where
rows are read from the bottom (negative readout) it is ``stamp - time_offset_s + m + |readout_s| * (1 - v / height)``.
"""

from __future__ import annotations

from enum import StrEnum
from math import isfinite, sqrt

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, ns_from_s

LONGEST_EXPOSURE_S = 1.0
"""More is no exposure of a camera on something that flies: the configured one is taken."""
INTERVAL_BEFORE_ANY_S = 1.0 / 30.0
"""The frame interval that is assumed until two frames have told theirs."""
INTERVALS_KEPT = 61
"""Odd, so that the median is one of them; half must be gaps before gaps are taken for the rate."""
LONGEST_INTERVAL_NS = 1 * NS_PER_S
"""A longer one is a pause, and says nothing about the readout."""


class StampRule(StrEnum):
    """What a frame's stamp marks."""

    ROW0_MID = "row0_mid"
    ROW0_START = "row0_start"
    ROW0_END = "row0_end"


class CameraTiming(msgspec.Struct, frozen=True, kw_only=True):
    """[camera], as far as it is about time."""

    time_offset_s: float = 0.0
    """Positive: stamps come late."""
    readout_s: float | None = None
    """From the first row to the last; negative: read from the bottom; None: unknown."""
    stamp_rule: StampRule = StampRule.ROW0_MID
    exposure_s: float = 0.0
    """Where a frame does not carry its own."""


class FrameTiming(msgspec.Struct, frozen=True, gc=False):
    """The capture of the rows of one frame, on the clock of its stamp."""

    first_row_ns: int
    """Of v = 0."""
    slope_ns: float
    """By which row ``height`` was captured later than row 0; negative: earlier."""
    height: int

    def capture_ns(self, v: float) -> int:
        """Of row v."""
        return self.first_row_ns + round(self.slope_ns * v / self.height)

    def row_fraction(self, v: float) -> float:
        """How far down the readout this row lies, 0 to 1."""
        down = min(1.0, max(0.0, v / self.height))
        return down if self.slope_ns >= 0.0 else 1.0 - down

    @property
    def earliest_ns(self) -> int:
        """Of any row."""
        return min(self.capture_ns(0.0), self.capture_ns(self.height))

    @property
    def latest_ns(self) -> int:
        """Of any row."""
        return max(self.capture_ns(0.0), self.capture_ns(self.height))


class RowClock:
    """Places rows in time, and learns an unknown readout from the rate of the frames."""

    __slots__ = ("_intervals", "_last_stamp_ns", "_timing", "interval_s")

    def __init__(self, timing: CameraTiming) -> None:
        self._timing = timing
        self._intervals: list[int] = []
        self.interval_s = INTERVAL_BEFORE_ANY_S
        """The median interval between frames."""
        self._last_stamp_ns: int | None = None

    @property
    def time_offset_s(self) -> float:
        """How late stamps are taken to come."""
        return self._timing.time_offset_s

    @property
    def readout_s(self) -> float:
        """As configured; unknown: half the median frame interval."""
        return 0.5 * self.interval_s if self._timing.readout_s is None else self._timing.readout_s

    @property
    def readout_sigma_s(self) -> float:
        """One sigma of the readout: unknown, it is uniform from nothing to a frame interval, one through a flight."""
        return self.interval_s / sqrt(12.0) if self._timing.readout_s is None else 0.0

    @property
    def readout_scale(self) -> float:
        """How much wider an unknown readout is than [uncertainty] has it, which takes 30 frames/s for granted."""
        return self.interval_s / INTERVAL_BEFORE_ANY_S if self._timing.readout_s is None else 1.0

    def set_time_offset(self, time_offset_s: float) -> None:
        """Stamps come this late, from now on."""
        self._timing = msgspec.structs.replace(self._timing, time_offset_s=time_offset_s)

    def see(self, stamp_ns: int) -> None:
        """A frame with this stamp came: its distance to the latest one before is an interval. A late one tells none."""
        last_ns = self._last_stamp_ns
        if last_ns is not None and -LONGEST_INTERVAL_NS <= stamp_ns - last_ns <= 0:
            return
        self._last_stamp_ns = stamp_ns
        if last_ns is not None and 0 < stamp_ns - last_ns <= LONGEST_INTERVAL_NS:
            self._intervals.append(stamp_ns - last_ns)
            if len(self._intervals) > INTERVALS_KEPT:
                del self._intervals[0]
            self.interval_s = sorted(self._intervals)[len(self._intervals) // 2] * 1e-9

    def place(self, stamp_ns: int, exposure_s: float | None, height: int) -> FrameTiming:
        """The rows of a frame with this stamp; ``height`` is that of the calibration's image."""
        readout_s = self.readout_s
        marked_ns = stamp_ns + ns_from_s(self._middle_s(exposure_s) - self._timing.time_offset_s)
        if readout_s < 0.0:  # the stamp marks the bottom row
            marked_ns += ns_from_s(-readout_s)
        return FrameTiming(marked_ns, readout_s * NS_PER_S, height)

    def _middle_s(self, exposure_s: float | None) -> float:
        """From what the stamp marks to the middle of that row's exposure."""
        if exposure_s is None or not (isfinite(exposure_s) and 0.0 <= exposure_s <= LONGEST_EXPOSURE_S):
            exposure_s = self._timing.exposure_s
        if self._timing.stamp_rule is StampRule.ROW0_START:
            return 0.5 * exposure_s
        return -0.5 * exposure_s if self._timing.stamp_rule is StampRule.ROW0_END else 0.0
