"""Measures the real delivery of a camera, and the time that the detector takes. PURE."""

from __future__ import annotations

from collections import deque
from statistics import median

import msgspec

from fwav_companion.types.camera import DeliveryReport

WINDOW = 60
"""Number of pictures over which rates and medians are taken: two seconds at 30 frames/s."""
FROZEN_S = 2.0
FROZEN_PICTURES = 10
"""Time and number of bit-identical pictures from which a camera is frozen: in a live camera, noise changes them."""


class DeliveredPicture(msgspec.Struct, frozen=True):
    """One picture as delivered. Instants on CLOCK_MONOTONIC, seconds."""

    arrived_s: float
    detected_s: float
    """Instant at which its detections were sent."""
    size: tuple[int, int]
    look: int
    """A checksum of its pixels."""
    stamp_s: float | None = None
    """Stamp of the picture; None if it is on another clock."""
    exposure_s: float | None = None
    skipped: int = 0
    """Number of pictures that were skipped before it."""
    clock: str = ""


class DeliveryMeter:
    """Statistics of the newest pictures."""

    def __init__(self) -> None:
        self._pictures: deque[DeliveredPicture] = deque(maxlen=WINDOW)
        self._skipped = 0
        self._same_since_s = 0.0
        self._same = 0

    def add(self, picture: DeliveredPicture) -> None:
        """Count a picture."""
        before = self._pictures[-1] if self._pictures else None
        if before is None or before.look != picture.look:
            self._same, self._same_since_s = 0, picture.arrived_s
        self._same += 1
        self._skipped += picture.skipped
        self._pictures.append(picture)

    @property
    def is_frozen(self) -> bool:
        """Whether the camera repeats one picture."""
        if not self._pictures:
            return False
        return self._same >= FROZEN_PICTURES and self._pictures[-1].arrived_s - self._same_since_s >= FROZEN_S

    def report(self) -> DeliveryReport | None:
        """Statistics of the camera's delivery; None before the second picture."""
        if len(self._pictures) < 2:
            return None
        first, last = self._pictures[0], self._pictures[-1]
        arrivals = sum(1 + each.skipped for each in list(self._pictures)[1:])
        span_s = last.arrived_s - first.arrived_s
        ages = [each.arrived_s - each.stamp_s for each in self._pictures if each.stamp_s is not None]
        takes_s = median(each.detected_s - each.arrived_s for each in self._pictures)
        return DeliveryReport(
            size=last.size,
            fps=arrivals / span_s if span_s > 0.0 else 0.0,
            exposure_s=last.exposure_s,
            clock=last.clock,
            age_s=median(ages) if ages else None,
            detector_hz=1.0 / takes_s if takes_s > 0.0 else 0.0,
            skipped=self._skipped,
            frozen=self.is_frozen,
        )
