"""Tiles of a model: what cutting and merging cost beside the passes of the model.

``python -m tests.benchmarks.tiles``
"""

from __future__ import annotations

import numpy as np

from fwav_companion.vision.detectors.model.boxes import Boxes
from fwav_companion.vision.detectors.model.letterbox import fit
from fwav_companion.vision.detectors.model.tiles import PassBoxes, merged, tiles_of
from tests.benchmarks.figure import Figure, interleaved

WIDTH, HEIGHT, INPUT = 3840, 2160, (640, 640)
BOXES = 120


def cutting() -> Figure:
    """Letterboxing 4 x 3 tiles of a 4K picture and the whole, against the whole picture alone."""
    picture = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
    tiles = tiles_of(WIDTH, HEIGHT, 4, 3)

    def whole() -> None:
        fit(picture, INPUT, "letterbox")

    def cut() -> None:
        for tile in tiles:
            fit(picture[tile.top : tile.bottom, tile.left : tile.right], INPUT, "letterbox")

    whole_s, cut_s = interleaved(whole, cut)
    detail = f"the whole {whole_s * 1e3:.1f} ms, {len(tiles)} passes {cut_s * 1e3:.1f} ms; the model runs once a pass"
    return Figure("tiles 4 x 3 at 4K: fitting, beside the whole picture alone", cut_s / whole_s, 40.0, False, detail)


def merging() -> Figure:
    """Merging the boxes of all passes into one detection a thing."""
    rng = np.random.default_rng(2)
    corner = rng.uniform(0.0, 3000.0, (BOXES, 2))
    edges = np.concatenate([corner, corner + rng.uniform(20.0, 80.0, (BOXES, 2))], axis=1)
    boxes = Boxes(edges, rng.uniform(0.3, 0.9, BOXES), np.zeros(BOXES, np.int64))
    passes = PassBoxes(boxes, rng.choice([1.8, 6.0], BOXES), rng.random((BOXES, 4)) < 0.1)
    (seconds,) = interleaved(lambda: merged(passes, 0.45))
    return Figure(f"merging {BOXES} boxes of tiles, ms", seconds * 1e3, 20.0, False, "numpy, one core")


def measure() -> list[Figure]:
    return [cutting(), merging()]


if __name__ == "__main__":
    print(*measure(), sep="\n")
