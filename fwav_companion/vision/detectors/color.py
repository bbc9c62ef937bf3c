"""Detects blobs of one strong colour: a panel, a buoy, a jacket. Grey pictures have none."""

from __future__ import annotations

import cv2
import numpy as np

from fwav_companion.vision.detectors.color_sigma import blob_sigma_px
from fwav_companion.vision.images import Found, Pixels

HUE_HALF_WIDTH_DEG = 15.0
LEAST_SATURATION, LEAST_VALUE = 110, 60
"""Least saturation and value of a pixel, of 255; grass, soil and concrete are below."""
LEAST_AREA_PX = 16
MOST_BLOBS = 32
FULL_COLOUR = 0.65
"""Share of a blob's strongest colour from which a pixel does not belong to its edge."""
STRONGEST_PERCENTILE = 90.0
"""Percentile of the colour of its pixels that is a blob's strongest colour: noise makes some pixels stronger."""


class ColorDetector:
    """Detector of the largest blobs of a hue."""

    def __init__(self, hue_deg: float) -> None:
        """``hue_deg``: 0 red, 60 yellow, 120 green, 240 blue."""
        self._hue = hue_deg % 360.0 / 2.0

    def detect(self, pixels: Pixels) -> list[Found]:
        """The blobs, each at its centre of mass."""
        if pixels.ndim == 2:
            return []
        hue, saturation, value = cv2.split(cv2.cvtColor(pixels, cv2.COLOR_BGR2HSV))
        away = np.abs((hue.astype(np.float32) - self._hue + 90.0) % 180.0 - 90.0)
        like = (away <= HUE_HALF_WIDTH_DEG / 2.0) & (saturation >= LEAST_SATURATION) & (value >= LEAST_VALUE)
        _, labels, stats, centres = cv2.connectedComponentsWithStats(like.astype(np.uint8), connectivity=8)
        order = sorted(range(1, len(stats)), key=lambda blob: -int(stats[blob][cv2.CC_STAT_AREA]))[:MOST_BLOBS]
        found = []
        for blob in order:
            left, top, width, height, area = (int(number) for number in stats[blob])
            if area >= LEAST_AREA_PX:
                here = (slice(top, top + height), slice(left, left + width))
                inside = labels[here] == blob
                edge = edge_share(saturation[here][inside], value[here][inside])
                found.append(_found(stats[blob], centres[blob], blob_sigma_px(area, edge)))
        return found


def edge_share(saturation: Pixels, value: Pixels) -> float:
    """Share of a blob's pixels with clearly less than its full colour: pixels of its edge and of its motion blur."""
    colour = saturation.astype(np.float32) * value
    return float(np.mean(colour < FULL_COLOUR * np.percentile(colour, STRONGEST_PERCENTILE)))


def _found(stats: np.ndarray, centre: np.ndarray, sigma_px: float) -> Found:
    left, top, width, height, _ = (int(number) for number in stats)
    return {
        "u": round(float(centre[0]), 3),
        "v": round(float(centre[1]), 3),
        "sigma": round(sigma_px, 3),
        "label": "color",
        "box": [left - 0.5, top - 0.5, left + width - 0.5, top + height - 0.5],
    }
