"""Tiles: overlapping slices of a large picture, and the merge of what they show.

A thing of 20 px in a picture of 3840 x 2160 is 3 px in an input of 640. In slices it keeps its size. A box that touches
an inner border of a tile is a part: it gives way to the whole thing as another tile or the pass over the whole picture
shows it. Parts of one thing that no pass shows whole are joined.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from fwav_companion.vision.detectors.model.box_sigma import cut_by
from fwav_companion.vision.detectors.model.boxes import Array, Boxes, Chosen, Flags, areas_of, common_areas

OVERLAP: Final = 0.2
"""Share of a tile that the next one shows too: a thing smaller than this is whole in one of them."""
PART_SHARE: Final = 0.5
"""Least share of a part's area inside another box of its class, at which both are one thing."""
CUT_INPUT_PX: Final = 2.0
"""Distance from a tile's border at which it cuts a box, pixels of the model's input: boxes end early by up to two."""


@dataclass(frozen=True)
class Tile:
    """A part of a picture, in whole pixels."""

    left: int
    top: int
    right: int
    bottom: int

    def borders(self, width: int, height: int) -> tuple[bool, bool, bool, bool]:
        """Which of left, top, right, bottom lie inside the picture."""
        return self.left > 0, self.top > 0, self.right < width, self.bottom < height


@dataclass(frozen=True)
class PassBoxes:
    """Detections of one or more passes over a picture, in its pixels."""

    boxes: Boxes
    px_per_input: Array
    """(N) pixels of the picture per pixel of the model's input."""
    cut: Flags
    """(N, 4) flags of the edges that inner borders of tiles cut off."""

    def where(self, chosen: Chosen) -> PassBoxes:
        """Some of the detections."""
        return PassBoxes(self.boxes.where(chosen), self.px_per_input[chosen], self.cut[chosen])


def tiles_of(width: int, height: int, columns: int, rows: int) -> list[Tile]:
    """The tiles of a picture, then the whole picture; the whole picture alone for one column and row."""
    whole = Tile(0, 0, width, height)
    if columns == rows == 1:
        return [whole]
    across, down = _spans(width, columns), _spans(height, rows)
    return [*(Tile(left, top, right, bottom) for (top, bottom), (left, right) in product(down, across)), whole]


def _spans(length: int, count: int) -> list[tuple[int, int]]:
    """Equal spans that overlap by OVERLAP."""
    span = length / (count - OVERLAP * (count - 1))
    starts = [round(i * span * (1.0 - OVERLAP)) for i in range(count)]
    return [
        (start, min(length, start + round(span))) if i + 1 < count else (start, length)
        for i, start in enumerate(starts)
    ]


def cut_edges(edges: Array, tile: Tile, picture: tuple[int, int], px_per_input: float) -> Flags:
    """(N, 4) flags of the edges, in pixels of the tile, that its inner borders cut off."""
    near = cut_by(edges, tile.right - tile.left, tile.bottom - tile.top, CUT_INPUT_PX * px_per_input)
    flags: Flags = near & np.array(tile.borders(*picture))
    return flags


def merged(passes: PassBoxes, iou: float) -> PassBoxes:
    """One detection a thing: whole ones first, by resolution and score; parts join, or give way to a whole one."""
    boxes, cut = passes.boxes, passes.cut.copy()
    edges = boxes.edges.copy()
    parts = cut.any(axis=1)
    resolution = np.round(passes.px_per_input / passes.px_per_input.min(initial=np.inf), 2)
    order = np.lexsort((-boxes.scores, resolution, parts))
    areas, kept = areas_of(edges), list[int]()
    for i in order:
        if not _is_kept_already(int(i), kept, edges, areas, boxes, cut, iou):
            kept.append(int(i))
    chosen = np.array(kept, np.intp)
    found = PassBoxes(
        Boxes(edges, boxes.scores, boxes.classes, boxes.outlines, boxes.feet, boxes.coefficients),
        passes.px_per_input,
        cut,
    ).where(chosen)
    return found.where(np.argsort(-found.boxes.scores, kind="stable"))


def _is_kept_already(i: int, kept: list[int], edges: Array, areas: Array, boxes: Boxes, cut: Flags, iou: float) -> bool:
    """Whether a kept box is the same thing. A part that is joined to a kept part widens that one in place."""
    others = [k for k in kept if boxes.classes[k] == boxes.classes[i]]
    if not others:
        return False
    common = common_areas(edges[others], edges[i])
    for k, area in zip(others, common.tolist(), strict=True):
        if area <= 0.0:
            continue
        if not cut[i].any():
            if area > iou * (areas[i] + areas[k] - area):
                return True
        elif not cut[k].any():
            if area > PART_SHARE * areas[i]:
                return True
        elif area > PART_SHARE * min(areas[i], areas[k]) or _complete(cut[i], cut[k]):
            _join(i, k, edges, areas, cut)
            return True
    return False


def _complete(one: Flags, other: Flags) -> bool:
    """Whether each part goes on beyond a border where the other one does."""
    opposite = one[[2, 3, 0, 1]]
    return bool((opposite & other).any())


def _join(i: int, k: int, edges: Array, areas: Array, cut: Flags) -> None:
    """Widen box k by box i. An edge is that of the part that reaches farther, and cut off where that part's is."""
    for side in range(4):
        farther = edges[i, side] < edges[k, side] if side < 2 else edges[i, side] > edges[k, side]
        if farther:
            edges[k, side], cut[k, side] = edges[i, side], cut[i, side]
    areas[k] = areas_of(edges[k : k + 1])[0]
