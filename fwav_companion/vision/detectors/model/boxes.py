"""Boxes of a model, and non-maximum suppression."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Chosen = Flags | NDArray[np.intp]


@dataclass(frozen=True)
class Boxes:
    """Detections in one frame of coordinates: the model's input (edge coordinates) or the picture (pixels)."""

    edges: Array
    """(N, 4) left, top, right, bottom."""
    scores: Array
    """(N) scores."""
    classes: NDArray[np.int64]
    """(N) class numbers; negative: not a class."""
    outlines: Array | None = None
    """(N, 4, 2) corners of turned boxes; None for upright boxes."""
    feet: Array | None = None
    """(N, 2) midpoints of the confident ankles, NaN without one; None for models without keypoints."""
    coefficients: Array | None = None
    """(N, 32) weights of the prototypes of masks; None for models without masks."""

    def where(self, chosen: Chosen) -> Boxes:
        """Some of the detections."""
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        return replace(self, **{name: column[chosen] for name, column in columns.items() if column is not None})


def edges_of_centred(centred: Array) -> Array:
    """(N, 4) left, top, right, bottom of (N, 4) centre, width and height."""
    half = 0.5 * centred[:, 2:4]
    return np.concatenate([centred[:, :2] - half, centred[:, :2] + half], axis=1)


def corners_of_turned(centred: Array, angle: Array) -> Array:
    """(N, 4, 2) corners of boxes of centre, width and height, turned by ``angle``, radians from u toward v."""
    cos, sin = np.cos(angle), np.sin(angle)
    along = 0.5 * centred[:, 2:3] * np.stack([cos, sin], axis=1)  # (N, 2) half of the width
    across = 0.5 * centred[:, 3:4] * np.stack([-sin, cos], axis=1)  # (N, 2) half of the height
    middle = centred[:, :2]
    return np.stack(
        [middle - along - across, middle + along - across, middle + along + across, middle - along + across], axis=1
    )


def hulls(outlines: Array) -> Array:
    """(N, 4) upright boxes around outlines."""
    return np.concatenate([outlines.min(axis=1), outlines.max(axis=1)], axis=1)


def areas_of(edges: Array) -> Array:
    """(N) areas."""
    left, top, right, bottom = edges.T
    area: Array = np.maximum(0.0, right - left) * np.maximum(0.0, bottom - top)
    return area


def common_areas(edges: Array, one: Array) -> Array:
    """(N) areas that boxes have in common with one box, (4)."""
    across = np.minimum(edges[:, 2], one[2]) - np.maximum(edges[:, 0], one[0])
    along = np.minimum(edges[:, 3], one[3]) - np.maximum(edges[:, 1], one[1])
    common: Array = np.maximum(0.0, across) * np.maximum(0.0, along)
    return common


def suppressed(boxes: Boxes, iou: float, most: int) -> Boxes:
    """The best boxes, the best first, such that no two of one class overlap by more than ``iou``."""
    order = np.argsort(-boxes.scores, kind="stable")
    kept: list[int] = []
    areas = areas_of(boxes.edges)
    while len(order) and len(kept) < most:
        best, order = int(order[0]), order[1:]
        kept.append(best)
        common = common_areas(boxes.edges[order], boxes.edges[best])
        overlap = common > iou * (areas[order] + areas[best] - common)
        overlap &= boxes.classes[order] == boxes.classes[best]
        if boxes.outlines is not None:  # upright boxes around parallel diagonal things overlap, the things do not
            for place in np.flatnonzero(common > 0.0):
                same = boxes.classes[order[place]] == boxes.classes[best]
                overlap[place] = same and _turned_iou(boxes.outlines[best], boxes.outlines[order[place]]) > iou
        order = order[~overlap]
    return boxes.where(np.array(kept, np.intp))


def _turned_iou(one: Array, other: Array) -> float:
    first, second = one.astype(np.float32), other.astype(np.float32)
    common, _ = cv2.intersectConvexConvex(first, second)
    union = cv2.contourArea(first) + cv2.contourArea(second) - common
    return float(common / union) if union > 0.0 else 0.0
