"""Detects blobs of one strong colour: a panel, a buoy, a jacket. Grey pictures have none."""

from __future__ import annotations

from math import sqrt

import cv2
import numpy as np

from fwav_companion.vision.images import Found, Pixels

HUE_HALF_WIDTH_DEG = 15.0
LEAST_SATURATION, LEAST_VALUE = 110, 60
"""Of 255; grass, soil and concrete are below."""
LEAST_AREA_PX = 16
MOST_BLOBS = 32
SIGMA_OF_SIZE = 0.1
"""One sigma as a share of the blob's size: the blob's centre is not exactly the target's."""


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
        _, _, stats, centres = cv2.connectedComponentsWithStats(like.astype(np.uint8), connectivity=8)
        order = sorted(range(1, len(stats)), key=lambda blob: -int(stats[blob][cv2.CC_STAT_AREA]))[:MOST_BLOBS]
        return [_found(stats[blob], centres[blob]) for blob in order if stats[blob][cv2.CC_STAT_AREA] >= LEAST_AREA_PX]


def _found(stats: np.ndarray, centre: np.ndarray) -> Found:
    left, top, width, height, area = (int(number) for number in stats)
    return {
        "u": round(float(centre[0]), 3),
        "v": round(float(centre[1]), 3),
        "sigma": round(max(0.5, SIGMA_OF_SIZE * sqrt(area)), 3),
        "label": "color",
        "box": [left - 0.5, top - 0.5, left + width - 0.5, top + height - 0.5],
    }
