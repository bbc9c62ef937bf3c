"""Stamps that are no capture times: they repeat, or jump back to times at which other frames were captured. Pure."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.types import Frame

KEPT = 64
"""Number of stamps that a new one is compared with: two seconds at 30 Hz."""
NEAR = 0.6
"""Largest distance of a stamp that jumped to another one, frame intervals. Frames that come late and out of order are
one interval apart; where stamps jump, two frames share one interval, and lie half an interval apart at most."""
GOES_ON = 2.0
"""Largest step, frame intervals, of a stamp that goes on where the one before had jumped to. After a late frame stamps
return to the newest ones."""


class StampSeries:
    """Counts stamps that repeat, and stamps that jump."""

    def __init__(self) -> None:
        self.repeated = 0
        """Number of frames with the stamp of the frame before; copies of that frame do not count."""
        self.jump_count = 0
        """Number of frames that were stamped earlier than the frame before, at the time of another one, or so that the
        next frame goes on from there."""
        self._stamps: deque[int] = deque()
        self._sorted: list[int] = []
        self._arrivals: deque[HostNs] = deque(maxlen=KEPT)
        self._last: Frame | None = None
        self._fell = False
        """Whether the frame before was stamped earlier than the one before it."""

    def add(self, frame: Frame, arrival_ns: HostNs) -> None:
        """Take one frame as it arrived."""
        last, self._last = self._last, frame
        stamp_ns, stamps = frame.stamp_ns, self._sorted
        if last is not None and stamp_ns == last.stamp_ns:
            self.repeated += not _is_copy(frame, last)
            return
        fell, self._fell = self._fell, last is not None and stamp_ns < last.stamp_ns
        at = bisect_left(stamps, stamp_ns)
        if self._fell:
            near_ns = min([abs(stamp_ns - each) for each in stamps[max(0, at - 1) : at + 1]], default=None)
            self.jump_count += near_ns is not None and near_ns < NEAR * self._interval_ns()
        elif last is not None and fell:
            self.jump_count += stamp_ns - last.stamp_ns < GOES_ON * self._interval_ns()
        self._arrivals.append(arrival_ns)
        insort(stamps, stamp_ns)
        self._stamps.append(stamp_ns)
        if len(stamps) > KEPT:
            del stamps[bisect_left(stamps, self._stamps.popleft())]

    def _interval_ns(self) -> float:
        """Mean interval of the arrivals; 0 before the third."""
        arrivals = self._arrivals
        return (arrivals[-1] - arrivals[0]) / (len(arrivals) - 1) if len(arrivals) > 2 else 0.0


def _is_copy(frame: Frame, other: Frame) -> bool:
    """Whether a frame with the stamp of the one before is that frame again: it is refused as a duplicate."""
    return frame.number == other.number and (frame.number is not None or frame.detections == other.detections)
