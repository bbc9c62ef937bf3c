"""The ray of a detection, or the reason for its refusal; independent of the vehicle. Pure."""

from __future__ import annotations

from collections.abc import Collection
from math import isfinite

from fwav_companion.pairing.anchors import marker_centre
from fwav_companion.types import Detection, Lens, NoRay, Ray, Reason
from fwav_companion.types.spots import CLICK_LABEL


class DetectionRays:
    """Selects detections by label and score, and gives the ray of each through the lens."""

    def __init__(self, lens: Lens, min_score: float, labels: Collection[str]) -> None:
        """``labels`` empty: all."""
        self._lens = lens
        self._min_score = min_score
        self._labels = frozenset(labels)

    def selected(self, detection: Detection) -> Ray | Reason:
        """The ray of a detection, or the reason for its refusal."""
        if not _finite(detection):
            return Reason.NOT_FINITE
        if detection.label != CLICK_LABEL:
            if detection.score is not None and not detection.score >= self._min_score:
                return Reason.LOW_SCORE
            if self._labels and detection.label not in self._labels:
                return Reason.OTHER_LABEL
        return self.ray(detection)

    def ray(self, detection: Detection) -> Ray | Reason:
        """The ray of a pixel, whatever its label and score."""
        width, height = self._lens.image_size
        if not (-0.5 <= detection.u <= width - 0.5 and -0.5 <= detection.v <= height - 0.5):
            return Reason.OUTSIDE_IMAGE
        u, v = (detection.u, detection.v) if detection.corners is None else marker_centre(detection, self._lens)
        ray = self._lens.camera_ray_and_derivatives_from_pixel(u, v)
        return ray.reason if isinstance(ray, NoRay) else ray


def _finite(detection: Detection) -> bool:
    if not (isfinite(detection.u) and isfinite(detection.v)):
        return False
    if detection.score is not None and not isfinite(detection.score):
        return False
    if detection.sigma is None:
        return True
    su, sv = detection.sigma
    return su > 0.0 and sv > 0.0 and isfinite(su) and isfinite(sv)
