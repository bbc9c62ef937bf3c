"""Detections told in pixels of another image size than the calibration's."""

from __future__ import annotations

import msgspec

from fwav_companion.types import Corners, Detection, Reason


class Scaling(msgspec.Struct, frozen=True, gc=False):
    """Calibration pixels per told pixel, each way. Pixel centres are at whole numbers, so the edge is at -0.5."""

    horizontal: float
    vertical: float

    def detection(self, told: Detection) -> Detection:
        """The detection in the pixels of the calibration."""
        if self.horizontal == self.vertical == 1.0:
            return told
        h, v = self.horizontal, self.vertical
        box = told.box
        return Detection(
            u=_scaled(told.u, h),
            v=_scaled(told.v, v),
            sigma=None if told.sigma is None else (told.sigma[0] * h, told.sigma[1] * v),
            label=told.label,
            score=told.score,
            box=None
            if box is None
            else (_scaled(box[0], h), _scaled(box[1], v), _scaled(box[2], h), _scaled(box[3], v)),
            detector_id=told.detector_id,
            corners=None if told.corners is None else self._corners(told.corners),
        )

    def _corners(self, told: Corners) -> Corners:
        first, second, third, fourth = ((_scaled(u, self.horizontal), _scaled(v, self.vertical)) for u, v in told)
        return (first, second, third, fourth)


def scaling_from_size(told: tuple[int, int] | None, calibrated: tuple[int, int]) -> Scaling | Reason:
    """WRONG_SIZE where the shapes differ by more than the rounding to whole pixels."""
    if told is None or told == calibrated:
        return Scaling(1.0, 1.0)
    width, height = told
    if width <= 0 or height <= 0:
        return Reason.WRONG_SIZE
    horizontal, vertical = calibrated[0] / width, calibrated[1] / height
    if abs(height - calibrated[1] / horizontal) >= 1.0 and abs(width - calibrated[0] / vertical) >= 1.0:
        return Reason.WRONG_SIZE
    return Scaling(horizontal, vertical)


def _scaled(pixel: float, scale: float) -> float:
    return scale * (pixel + 0.5) - 0.5
