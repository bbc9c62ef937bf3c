"""The spot tracker at 640x480 and 30 frames/s: its share of one core.

``python -m tests.benchmarks.patch``
"""

from __future__ import annotations

import cv2
import numpy as np

from fwav_companion.types.spots import FollowSpot, SpotView
from fwav_companion.vision.patch import FollowedSpots, KeptPictures
from tests.benchmarks.figure import Figure, interleaved

HZ = 30.0
PICTURES = 30
SCALE = (50.0, 5.0, -5.0, 50.0)
"""Pixels a metre from 12 m, slightly turned."""
REACH_PX = 30.0
"""Search of a spot whose track is known to 0.1 m relative to the vehicle: 12 px + 3 sigma of 50 px/m."""


def measure() -> list[Figure]:
    noise = np.random.default_rng(1).standard_normal((480, 640)).astype(np.float32)
    ground = np.clip(118.0 + 100.0 * cv2.GaussianBlur(noise, (0, 0), 2.0), 0, 255).astype(np.uint8)
    kept = KeptPictures()
    kept.add(0, ground)
    spots = FollowedSpots(kept)
    if spots.follow(FollowSpot(1, 0, SpotView((320.0, 240.0), SCALE, 0.0))) is not None:
        raise AssertionError("the spot was refused")
    shown = [np.roll(ground, (3 * k % 11, 7 * k % 23), axis=(0, 1)) for k in range(PICTURES)]
    view = {1: SpotView((330.0, 245.0), SCALE, REACH_PX)}
    if not all(spots.detections(each, view) for each in shown):
        raise AssertionError("the spot was not found")
    (seconds,) = interleaved(lambda: [spots.detections(each, view) for each in shown])
    each_ms = seconds / PICTURES * 1e3
    detail = f"{each_ms:.2f} ms a picture, search of {REACH_PX:.0f} px"
    return [Figure("spot tracker at 640x480, 30 frames/s, share of a core", HZ * each_ms / 1e3, 0.1, False, detail)]


if __name__ == "__main__":
    print(*measure(), sep="\n")
