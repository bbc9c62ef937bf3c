"""Likelihood that a fix is clutter, with which its likelihood as a fix of a target is compared."""

from __future__ import annotations

from math import dist, log, pi, sqrt

import msgspec

from fwav_companion.geometry.vectors import cross, norm
from fwav_companion.tracking.crowd import NO_CROWD, Crowd
from fwav_companion.tracking.detector_model import DetectorModel
from fwav_companion.types import GroundFix

MOST_FALSE = 1.0
"""Number of false detections a frame up to which a steady track takes a fix that is more likely clutter. With more of
them, such fixes keep a track of clutter alive: at three a frame one lived for 25 s of 60."""
LEAST_NOISE_PX2 = 1e-3
"""Lower bound of the area of a fix's noise ellipse, square pixels: a detector's smaller value is not plausible."""


class Clutter(msgspec.Struct, frozen=True):
    """Clutter density and detection odds of one frame, with which fixes are compared."""

    false_per_px2: float
    """False detections of a frame per square pixel."""
    detection_odds: float
    """Twice the log of the odds of a detection over a missed one, at most 0."""
    miss_cost: float = 0.0
    """The same log-odds, at least 0: cost of a target in view without a fix."""
    far_cost: float = 0.0
    """Cost below which a steady track takes a fix: ``miss_cost`` where false detections are rare, otherwise 0."""

    crowd: Crowd = NO_CROWD
    """Labels of which false detections are denser now."""
    image_px2: float = 1.0

    def llr_of(self, fix: GroundFix) -> float:
        """Sum of NIS and log determinant ratio of a fix at which target and clutter are equally likely."""
        false_per_px2 = self.false_per_px2
        if self.crowd.labels:
            crowded = self.crowd.false_per_frame(fix.sighting.detection.label) / self.image_px2
            false_per_px2 = max(false_per_px2, crowded)
        return -2.0 * log(false_per_px2 * noise_area_px2(fix))


def clutter(detector: DetectorModel, image_px2: float) -> Clutter:
    """The clutter of a frame. ``image_px2``: area of the image, square pixels."""
    probability = detector.detection_probability
    odds = 2.0 * log(probability / (1.0 - probability))
    false, miss_cost = detector.false_per_frame, max(0.0, odds)
    few = false <= MOST_FALSE and not detector.crowd.labels
    return Clutter(false / image_px2, min(0.0, odds), miss_cost, miss_cost if few else 0.0, detector.crowd, image_px2)


def noise_area_px2(fix: GroundFix) -> float:
    """Area 2 pi sqrt(det R) of the fix's horizontal noise, in square pixels of its image.

    A square pixel covers ``|d_du x d_dv| r^3 / h`` of level ground, at the slant range r and the height h.
    """
    (nn, ne, _), (_, ee, _), _ = fix.noise_cov
    sighting, ray = fix.sighting, fix.sighting.ray
    range_m, height_m = dist(fix.position_ned, sighting.camera_ned), fix.position_ned[2] - sighting.camera_ned[2]
    ground_per_px2 = norm(cross(ray.d_du, ray.d_dv)) * range_m * range_m * range_m / max(abs(height_m), 1e-3)
    return max(LEAST_NOISE_PX2, 2.0 * pi * sqrt(max(0.0, nn * ee - ne * ne)) / ground_per_px2)
