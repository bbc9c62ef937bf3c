"""Tags of landing pads in a frame: which a detector reads, and their corners with its noise."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import hypot, inf
from random import Random
from typing import Any

from sitl_mock.lens import Lens, Pixel
from sitl_mock.options import CameraOptions
from sitl_mock.rotation import Vector
from sitl_mock.scene import Target
from sitl_mock.tags import BOARD, LEAST_MODULE_PX, MODULES, PRINT_CORNERS, PadTag

Rolled = Callable[[Callable[[float], Vector], float], tuple[Pixel, float]]
"""(pixel, flight time of its row) of a moving place in the frame whose first row is exposed at a flight time."""


class PadTags:
    """The detector of pads' tags. Its draws are its own: flights without pads are what they were."""

    def __init__(self, options: CameraOptions, seed: int, lens: Lens, rolled: Rolled) -> None:
        self._c, self._lens, self._rolled = options, lens, rolled
        self._rng = Random(f"{seed}/pads")

    def detections(self, pad: Target, row0_s: float) -> list[dict[str, Any]]:
        """The tags of a pad that a detector reads in a frame, in the wire format."""
        sigma = self._c.corner_noise_px or 0.0
        found = []
        for tag in (PadTag(pad, each) for each in pad.tags):
            missed = self._rng.random() < self._c.missed
            corners = self._pixels(tag, 1.0, row0_s)
            noisy = [(u + self._rng.gauss(0.0, sigma), v + self._rng.gauss(0.0, sigma)) for u, v in corners]
            if missed or not self._is_read(tag, corners, row0_s):
                continue
            u, v = _crossing(noisy)
            detection: dict[str, Any] = {"u": round(u, 4), "v": round(v, 4), "label": tag.printed.label, "score": 0.9}
            if sigma:
                detection["sigma"] = round(sigma / 2.0, 4)
            detection["corners"] = [[round(u, 4), round(v, 4)] for u, v in noisy]
            found.append(detection)
        return found

    def _is_read(self, tag: PadTag, corners: list[Pixel], row0_s: float) -> bool:
        if not all(self._lens.sees(*pixel) for pixel in self._pixels(tag, BOARD, row0_s)):
            return False
        shortest = min(
            (hypot(b[0] - a[0], b[1] - a[1]) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)),
            default=inf,
        )
        return shortest >= LEAST_MODULE_PX * MODULES

    def _pixels(self, tag: PadTag, scale: float, row0_s: float) -> list[Pixel]:
        """Pixels of a square's corners about a tag's centre; ``scale``: its side over that of the black square."""
        return [self._rolled(partial(tag.at, scale * right, scale * down), row0_s)[0] for right, down in PRINT_CORNERS]


def _crossing(corners: list[Pixel]) -> Pixel:
    """Crossing of the diagonals."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = corners
    area = (cx - ax) * (dy - by) - (cy - ay) * (dx - bx)
    share = ((bx - ax) * (dy - by) - (by - ay) * (dx - bx)) / area
    return ax + share * (cx - ax), ay + share * (cy - ay)
