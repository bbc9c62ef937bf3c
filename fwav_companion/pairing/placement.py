"""A frame placed in time, or refused whole: too late, from the future, seen before, of another camera."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.pairing.protocols import TwoClocks
from fwav_companion.pairing.scaling import Scaling, scaling_from_size
from fwav_companion.pairing.timing import FrameTiming, RowClock
from fwav_companion.types import Frame, Reason, StampClock, Unpaired

MOST_DETECTIONS = 256
"""In one frame."""
FUTURE_SLACK_NS = 5_000_000
FUTURE_SIGMAS = 3.0
"""A capture may lie so far after the arrival: what clocks and stamps leave open."""
LATEST_NS = 500_000_000
"""The reorder window: older than this at its arrival, a frame has nowhere to go."""
FRAMES_REMEMBERED = 256
"""For telling duplicates: half a second of any camera."""


class Placement(msgspec.Struct, frozen=True, gc=False):
    """Where a frame's rows lie in time."""

    timing: FrameTiming
    scaling: Scaling
    host_ns: HostNs
    """Capture of row 0, host clock."""
    boot_ns: BootNs
    """The same on the autopilot's."""


class FramePlacer:
    """Places frames. It remembers those that it has seen, and has an unknown readout learned from their rate."""

    __slots__ = ("_image_size", "_rows", "_seen")

    def __init__(self, image_size: tuple[int, int], rows: RowClock) -> None:
        """``image_size``: of the calibration."""
        self._image_size = image_size
        self._rows = rows
        self._seen: dict[tuple[object, ...], None] = {}

    def attitude_needed_until(self, frame: Frame, clock: TwoClocks) -> BootNs | None:
        """The autopilot's instant of the latest row in which something was seen, and of row 0, which attitudes should
        reach; None where it is not known. What was exposed later than that holds nothing up.
        """
        timing, height = self._timing_of(frame), self._image_size[1]
        scale = 1.0 if frame.size is None else height / max(1, frame.size[1])
        rows = (scale * (detection.v + 0.5) - 0.5 for detection in frame.detections)
        latest_ns = max(timing.capture_ns(v) for v in (0.0, *(v for v in rows if 0.0 <= v <= height)))
        if frame.stamp_clock is StampClock.BOOT:
            return BootNs(latest_ns)
        boot_ns = clock.boot_from_host(HostNs(latest_ns))
        return None if isinstance(boot_ns, Unpaired) else boot_ns

    def assumed_arrival(self, frame: Frame, clock: TwoClocks) -> HostNs | Unpaired:
        """When a recorded frame without an arrival is taken to have come: its last capture, or its stamp if later."""
        latest_ns = max(self._timing_of(frame).latest_ns, frame.stamp_ns)
        if frame.stamp_clock is StampClock.BOOT:
            return clock.host_from_boot(BootNs(latest_ns))
        return HostNs(latest_ns)

    def place(self, frame: Frame, clock: TwoClocks) -> Placement | Reason:
        """The frame's rows in time, or why it is refused whole."""
        if len(frame.detections) > MOST_DETECTIONS:
            return Reason.TOO_MANY_DETECTIONS
        scaling = scaling_from_size(frame.size, self._image_size)
        if isinstance(scaling, Reason):
            return scaling
        key = _identity(frame)
        if key in self._seen:
            return Reason.DUPLICATE_FRAME
        timing = self._timing_of(frame)
        both = both_clocks(timing.first_row_ns, frame.stamp_clock, clock)
        if isinstance(both, Unpaired):
            return both.reason
        host_ns, boot_ns = both
        if frame.arrival_ns is not None:
            untimely = _untimely(host_ns, frame.arrival_ns, clock)
            if untimely is not None:
                return untimely
        self._seen[key] = None
        if len(self._seen) > FRAMES_REMEMBERED:
            del self._seen[next(iter(self._seen))]
        self._rows.see(frame.stamp_ns)
        return Placement(timing, scaling, host_ns, boot_ns)

    def _timing_of(self, frame: Frame) -> FrameTiming:
        return self._rows.place(frame.stamp_ns, frame.exposure_s, self._image_size[1])


def both_clocks(instant_ns: int, told_on: StampClock, clock: TwoClocks) -> tuple[HostNs, BootNs] | Unpaired:
    """An instant on the host's clock and on the autopilot's; or why there is no telling."""
    if told_on is StampClock.BOOT:
        host_ns = clock.host_from_boot(BootNs(instant_ns))
        return host_ns if isinstance(host_ns, Unpaired) else (host_ns, BootNs(instant_ns))
    boot_ns = clock.boot_from_host(HostNs(instant_ns))
    return boot_ns if isinstance(boot_ns, Unpaired) else (HostNs(instant_ns), boot_ns)


def _untimely(capture_ns: HostNs, arrival_ns: HostNs, clock: TwoClocks) -> Reason | None:
    early_ns = capture_ns - arrival_ns
    if early_ns > FUTURE_SLACK_NS:  # hardly ever: the clock is asked only then
        sigma_ns = clock.estimate(arrival_ns).sigma_s * 1e9
        return Reason.FROM_THE_FUTURE if early_ns > FUTURE_SLACK_NS + FUTURE_SIGMAS * sigma_ns else None
    return Reason.TOO_LATE if -early_ns > LATEST_NS else None


def _identity(frame: Frame) -> tuple[object, ...]:
    """What a second copy of this frame would have in common with it: unnumbered ones, also what was seen."""
    if frame.number is not None:
        return (frame.number, frame.stamp_clock, frame.stamp_ns)
    return (frame.stamp_clock, frame.stamp_ns, frame.detections)
