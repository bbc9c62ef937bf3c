"""Capture time of each row of an image.

The capture of row v is ``stamp - time_offset_s + m + readout_s * v / height``, with m by the event that the stamp
marks. Where rows are read from the bottom (negative readout) it is
``stamp - time_offset_s + m + |readout_s| * (1 - v / height)``.
"""

from __future__ import annotations

from enum import StrEnum
from math import isfinite, sqrt

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, ns_from_s

LONGEST_EXPOSURE_S = 1.0
"""Longest exposure of a frame that is used; for longer ones the configured exposure is used."""
INTERVAL_BEFORE_ANY_S = 1.0 / 30.0
"""Frame interval that is assumed before the second frame."""
INTERVALS_KEPT = 61
"""Intervals of the median: odd, so that the median is one of them, and robust until half of them are gaps."""
LATE_NS = 1 * NS_PER_S
"""Largest time of a late frame's stamp before the latest stamp; beyond it, the stamps began again."""
LONGEST_INTERVAL_NS = 60 * NS_PER_S
"""Longest frame interval that is used: of photographs; a longer one is a pause. The median tolerates many pauses."""
LONGEST_READOUT_S = 0.075
"""Longest readout that is assumed: the slowest known sensors, photo cameras of 24 x 36 mm with electronic shutters."""


class StampRule(StrEnum):
    """The event that a frame's stamp marks: a phase of the exposure of row 0."""

    ROW0_MID = "row0_mid"
    ROW0_START = "row0_start"
    ROW0_END = "row0_end"


class CameraTiming(msgspec.Struct, frozen=True, kw_only=True):
    """The timing keys of [camera]."""

    time_offset_s: float = 0.0
    """Delay of the stamps, seconds; positive: stamps come late."""
    readout_s: float | None = None
    """Time from the first row to the last, seconds; negative: read from the bottom; None: unknown."""
    stamp_rule: StampRule = StampRule.ROW0_MID
    """Event that a stamp marks."""
    exposure_s: float = 0.0
    """Exposure of frames that report none, seconds."""


class FrameTiming(msgspec.Struct, frozen=True, gc=False):
    """Capture of the rows of one frame on the clock of its stamp."""

    first_row_ns: int
    """Capture of row 0."""
    slope_ns: float
    """Capture of row ``height`` minus capture of row 0; negative: earlier."""
    height: int
    """Rows of the calibration's image."""

    def capture_ns(self, v: float) -> int:
        """The capture of row v."""
        return self.first_row_ns + round(self.slope_ns * v / self.height)

    def row_fraction(self, v: float) -> float:
        """The position of row v in the readout, 0 to 1."""
        down = min(1.0, max(0.0, v / self.height))
        return down if self.slope_ns >= 0.0 else 1.0 - down

    @property
    def latest_ns(self) -> int:
        """The latest capture of any row."""
        return max(self.capture_ns(0.0), self.capture_ns(self.height))


class RowClock:
    """Capture times of rows; an unknown readout is estimated from the frame rate."""

    __slots__ = (
        "_intervals",
        "_last_stamp_ns",
        "_timing",
        "interval_s",
        "readout_s",
        "readout_scale",
        "readout_sigma_s",
    )

    def __init__(self, timing: CameraTiming) -> None:
        self._timing = timing
        self._intervals: list[int] = []
        self._last_stamp_ns: int | None = None
        self._found(INTERVAL_BEFORE_ANY_S)

    @property
    def time_offset_s(self) -> float:
        """The delay of the stamps in use, seconds."""
        return self._timing.time_offset_s

    def _found(self, interval_s: float) -> None:
        """Set the median frame interval, and the readout times that follow from it."""
        # Longest possible readout: the frame interval, at most that of the slowest sensors.
        longest_s, readout_s = min(interval_s, LONGEST_READOUT_S), self._timing.readout_s
        self.interval_s = interval_s
        """Median interval between frames, seconds."""
        self.readout_s = 0.5 * longest_s if readout_s is None else readout_s
        """Readout time in use, seconds: as configured, else half of the longest possible one."""
        self.readout_sigma_s = longest_s / sqrt(12.0) if readout_s is None else 0.0
        """One sigma of the readout, seconds: an unknown one is uniform from 0 to the longest possible one."""
        self.readout_scale = longest_s / INTERVAL_BEFORE_ANY_S if readout_s is None else 1.0
        """Sigma of an unknown readout over its prior, which assumes 30 frames/s; 1 for a configured readout."""

    def see(self, stamp_ns: int) -> None:
        """Add the interval between this frame's stamp and the latest one before; a late frame adds none."""
        last_ns = self._last_stamp_ns
        if last_ns is not None and -LATE_NS <= stamp_ns - last_ns <= 0:
            return
        self._last_stamp_ns = stamp_ns
        if last_ns is not None and 0 < stamp_ns - last_ns <= LONGEST_INTERVAL_NS:
            self._intervals.append(stamp_ns - last_ns)
            if len(self._intervals) > INTERVALS_KEPT:
                del self._intervals[0]
            self._found(sorted(self._intervals)[len(self._intervals) // 2] * 1e-9)

    def place(self, stamp_ns: int, exposure_s: float | None, height: int) -> FrameTiming:
        """The capture times of the rows of a frame; ``height``: rows of the calibration's image."""
        readout_s = self.readout_s
        marked_ns = stamp_ns + ns_from_s(self._middle_s(exposure_s) - self._timing.time_offset_s)
        if readout_s < 0.0:  # the stamp marks the bottom row
            marked_ns += ns_from_s(-readout_s)
        return FrameTiming(marked_ns, readout_s * NS_PER_S, height)

    def _middle_s(self, exposure_s: float | None) -> float:
        """The time from the marked event to the middle of that row's exposure, seconds."""
        if exposure_s is None or not (isfinite(exposure_s) and 0.0 <= exposure_s <= LONGEST_EXPOSURE_S):
            exposure_s = self._timing.exposure_s
        if self._timing.stamp_rule is StampRule.ROW0_START:
            return 0.5 * exposure_s
        return -0.5 * exposure_s if self._timing.stamp_rule is StampRule.ROW0_END else 0.0
