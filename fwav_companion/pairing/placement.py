"""Frames in time and in the pixels of the calibration, or refused as a whole.

A frame is refused if it is too late, from the future, a duplicate, or of another aspect ratio than the calibration, and
where none of its detections has a pixel.
"""

from __future__ import annotations

from math import isfinite

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.pairing.protocols import TwoClocks
from fwav_companion.pairing.timing import FrameTiming, RowClock
from fwav_companion.types import Corners, Detection, Frame, Pixel, Reason, StampClock, Unpaired

MOST_DETECTIONS = 256
"""Most detections in one frame."""
FUTURE_SLACK_NS = 5_000_000
FUTURE_SIGMAS = 3.0
"""Largest time of a capture after the arrival: a fixed part, and sigmas of the clock."""
LATEST_NS = 500_000_000
"""Usual age of a frame at its arrival beyond which it is refused: that of the reorder window, and a check of the stamp,
since detectors with a wrong clock are more frequent than cameras that are later than this."""
MOST_ASSUMED_LATE_NS = 300_000_000
"""Largest delay of a stamp that delays a recorded frame's assumed arrival: it leaves time for attitudes and reordering.
"""
FRAMES_REMEMBERED = 256
"""Frames kept to detect duplicates: half a second of any camera."""


class Scaling(msgspec.Struct, frozen=True, gc=False):
    """Scale from the pixels of a frame to those of the calibration; pixel centres are integers, the edge is -0.5."""

    horizontal: float
    """Calibration pixels per frame pixel, horizontally."""
    vertical: float
    """Calibration pixels per frame pixel, vertically."""

    def detection(self, raw: Detection) -> Detection:
        """The detection in pixels of the calibration."""
        if self.horizontal == self.vertical == 1.0:
            return raw
        h, v = self.horizontal, self.vertical
        box = raw.box
        return Detection(
            u=_scaled(raw.u, h),
            v=_scaled(raw.v, v),
            sigma=None if raw.sigma is None else (raw.sigma[0] * h, raw.sigma[1] * v),
            label=raw.label,
            score=raw.score,
            box=None
            if box is None
            else (_scaled(box[0], h), _scaled(box[1], v), _scaled(box[2], h), _scaled(box[3], v)),
            detector_id=raw.detector_id,
            corners=None if raw.corners is None else self._corners(raw.corners),
            outline=None if raw.outline is None else tuple(map(self._pixel, raw.outline)),
            foot=None if raw.foot is None else self._pixel(raw.foot),
        )

    def _pixel(self, raw: Pixel) -> Pixel:
        return _scaled(raw[0], self.horizontal), _scaled(raw[1], self.vertical)

    def _corners(self, raw: Corners) -> Corners:
        first, second, third, fourth = map(self._pixel, raw)
        return (first, second, third, fourth)


def scaling_from_size(size: tuple[int, int] | None, calibrated: tuple[int, int]) -> Scaling | Reason:
    """The scale from a frame's image size to the calibration's.

    WRONG_SIZE where the aspect ratios differ by more than the rounding to whole pixels.
    """
    if size is None or size == calibrated:
        return Scaling(1.0, 1.0)
    width, height = size
    if width <= 0 or height <= 0:
        return Reason.WRONG_SIZE
    horizontal, vertical = calibrated[0] / width, calibrated[1] / height
    if abs(height - calibrated[1] / horizontal) >= 1.0 and abs(width - calibrated[0] / vertical) >= 1.0:
        return Reason.WRONG_SIZE
    return Scaling(horizontal, vertical)


def _scaled(pixel: float, scale: float) -> float:
    return scale * (pixel + 0.5) - 0.5


class Placement(msgspec.Struct, frozen=True, gc=False):
    """The rows of a frame in time, and its scale to the calibration."""

    timing: FrameTiming
    """Capture of each row, clock of the stamp."""
    scaling: Scaling
    """Scale to the pixels of the calibration."""
    host_ns: HostNs
    """Capture of row 0, host clock."""
    boot_ns: BootNs
    """Capture of row 0, autopilot clock."""


class PictureRows(msgspec.Struct, frozen=True, gc=False):
    """The rows of a frame of the companion's own camera in time, whether or not it is paired."""

    timing: FrameTiming
    """Capture of each row, clock of the stamp."""
    shift_ns: int
    """Host clock minus the clock of the stamp."""
    scaling: Scaling
    """Scale to the pixels of the calibration."""

    def host_ns(self, v: float) -> HostNs:
        """Capture of a row of the calibration's image."""
        return HostNs(self.timing.capture_ns(v) + self.shift_ns)

    @property
    def middle_ns(self) -> HostNs:
        """Capture of the middle row."""
        return self.host_ns(0.5 * self.timing.height)


class FramePlacer:
    """Places frames in time. It remembers frames to detect duplicates, and gives their stamps to the row clock."""

    __slots__ = ("_image_size", "_latest_ns", "_rows", "_seen")

    def __init__(self, image_size: tuple[int, int], rows: RowClock, latest_ns: int = LATEST_NS) -> None:
        """``image_size``: image size of the calibration. ``latest_ns``: age at its arrival beyond which a frame is
        refused.
        """
        self._latest_ns = latest_ns
        self._image_size = image_size
        self._rows = rows
        self._seen: dict[tuple[object, ...], None] = {}

    def attitude_needed_until(self, frame: Frame, clock: TwoClocks) -> BootNs | None:
        """The latest capture of row 0 and of the rows with detections, autopilot clock; None where it is not known.

        Attitudes should reach this instant before the frame is paired. Rows without detections are not waited for.
        """
        timing, height = self._timing_of(frame), self._image_size[1]
        scale = 1.0 if frame.size is None else height / max(1, frame.size[1])
        lowest = 0.0
        for detection in frame.detections:
            v = scale * (detection.v + 0.5) - 0.5
            if lowest < v <= height:
                lowest = v
        latest_ns = max(timing.first_row_ns, timing.capture_ns(lowest))
        if frame.stamp_clock is StampClock.BOOT:
            return BootNs(latest_ns)
        boot_ns = clock.boot_from_host(HostNs(latest_ns))
        return None if isinstance(boot_ns, Unpaired) else boot_ns

    def assumed_arrival(self, frame: Frame, clock: TwoClocks) -> HostNs | Unpaired:
        """Assumed arrival of a recorded frame without ``received_unix``: its last capture, or its stamp if later."""
        captured_ns = self._timing_of(frame).latest_ns
        late_ns = max(0, frame.stamp_ns - captured_ns)
        # A stamp later than any frame may arrive has a large time offset: such a frame is as fresh as any other.
        latest_ns = captured_ns + (late_ns if late_ns <= MOST_ASSUMED_LATE_NS else 0)
        if frame.stamp_clock is StampClock.BOOT:
            return clock.host_from_boot(BootNs(latest_ns))
        return HostNs(latest_ns)

    def picture_rows(self, frame: Frame, clock: TwoClocks) -> PictureRows | None:
        """The rows of a frame on the host clock, and its scale; None where the clock or the size is not known."""
        timing = self._timing_of(frame)
        scaling = scaling_from_size(frame.size, self._image_size)
        both = both_clocks(timing.first_row_ns, frame.stamp_clock, clock)
        if isinstance(both, Unpaired) or isinstance(scaling, Reason):
            return None
        return PictureRows(timing, both[0] - timing.first_row_ns, scaling)

    def place(self, frame: Frame, clock: TwoClocks) -> Placement | Reason:  # noqa: C901  (a loop in place of a call)
        """The placement of a frame, or the reason why it is refused as a whole."""
        if len(frame.detections) > MOST_DETECTIONS:
            return Reason.TOO_MANY_DETECTIONS
        scaling = scaling_from_size(frame.size, self._image_size)
        if isinstance(scaling, Reason):
            return scaling
        for each in frame.detections:
            if isfinite(each.u) and isfinite(each.v):
                break
        else:
            if frame.detections:  # before its stamp is remembered: a valid frame with this stamp may follow
                return Reason.NOT_FINITE
        key = _identity(frame)
        if key in self._seen:
            return Reason.DUPLICATE_FRAME
        timing = self._timing_of(frame)
        both = both_clocks(timing.first_row_ns, frame.stamp_clock, clock)
        if isinstance(both, Unpaired):
            return both.reason
        host_ns, boot_ns = both
        if frame.arrival_ns is not None:
            untimely = _untimely(host_ns, frame.arrival_ns, frame.stamp_clock, clock, self._latest_ns)
            if untimely is not None:
                return untimely
        self._seen[key] = None
        if len(self._seen) > FRAMES_REMEMBERED:
            del self._seen[next(iter(self._seen))]
        self._rows.see(frame.stamp_ns)
        return Placement(timing, scaling, host_ns, boot_ns)

    def _timing_of(self, frame: Frame) -> FrameTiming:
        return self._rows.place(frame.stamp_ns, frame.exposure_s, self._image_size[1])


def both_clocks(instant_ns: int, stamp_clock: StampClock, clock: TwoClocks) -> tuple[HostNs, BootNs] | Unpaired:
    """An instant of ``stamp_clock`` on both clocks, or the reason why the other clock is not known."""
    if stamp_clock is StampClock.BOOT:
        host_ns = clock.host_from_boot(BootNs(instant_ns))
        return host_ns if isinstance(host_ns, Unpaired) else (host_ns, BootNs(instant_ns))
    boot_ns = clock.boot_from_host(HostNs(instant_ns))
    return boot_ns if isinstance(boot_ns, Unpaired) else (HostNs(instant_ns), boot_ns)


def _untimely(
    capture_ns: HostNs, arrival_ns: HostNs, stamp_clock: StampClock, clock: TwoClocks, latest_ns: int
) -> Reason | None:
    """FROM_THE_FUTURE, TOO_LATE, or None for a capture at a plausible time before the arrival.

    NO_CLOCK where a stamp of the autopilot's clock may be in time, and that clock is not known well enough to say so.
    """
    early_ns = capture_ns - arrival_ns
    if -latest_ns <= early_ns <= FUTURE_SLACK_NS:
        return None
    # Rare, so the clock is evaluated only here. Near a slip its sigma is larger at the capture than at the arrival; one
    # after the arrival would count messages as missing that are still to come.
    sigma_s = max(clock.sigma_s_at(arrival_ns), clock.sigma_s_at(min(capture_ns, arrival_ns)))
    doubt_ns = FUTURE_SIGMAS * sigma_s * 1e9
    if early_ns > 0:
        return Reason.FROM_THE_FUTURE if early_ns > FUTURE_SLACK_NS + doubt_ns else None
    by_clock = stamp_clock is StampClock.BOOT and -early_ns <= latest_ns + doubt_ns
    return Reason.NO_CLOCK if by_clock else Reason.TOO_LATE


def _identity(frame: Frame) -> tuple[object, ...]:
    """The key by which a duplicate is detected: number and stamp, without a number the detections instead."""
    if frame.number is not None:
        return (frame.number, frame.stamp_clock, frame.stamp_ns)
    return (frame.stamp_clock, frame.stamp_ns, frame.detections)
