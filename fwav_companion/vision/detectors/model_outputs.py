"""The outputs of object detectors, by the layout of each family: boxes, scores and classes.

| format | outputs | boxes |
|---|---|---|
| yolov5, also v6 and v7 | (1, N, 5 + C): cx, cy, w, h, objectness, classes | input pixels |
| yolov8, also v9, v11 and v5u | (1, 4 + C, N): cx, cy, w, h, classes | input pixels |
| yolox | (1, N, 5 + C), raw head: cx, cy, log w, log h in cells of strides 8, 16, 32 | cells |
| yolov10, also others with their suppression | (1, N, 6): left, top, right, bottom, score, class | input pixels |
| rtdetr | (1, N, 4 + C): cx, cy, w, h, classes | shares of the input |
| nms7 | (N, 7): batch, left, top, right, bottom, class, score | input pixels |
| ssd | boxes (1, N, 4), then scores and classes (1, N) by their names | shares of the input |
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fwav_companion.vision.images import DetectorError

Array = NDArray[np.float64]
STRIDES = (8, 16, 32)
ANCHORS = 3
"""Number of boxes of each cell of YOLOv5 and v7; later models have one."""
MOST_QUERIES = 1000
"""Most boxes of DETR's and suppressed outputs, which have some hundred; outputs without suppression have 2100 and
more."""
SUPPRESSED = ("yolov10", "nms7", "ssd", "rtdetr")
"""Formats whose boxes do not overlap."""


@dataclass(frozen=True)
class Boxes:
    """Detections in the input of a model."""

    edges: Array
    """(N, 4) left, top, right, bottom, edge coordinates of the input."""
    scores: Array
    """(N) scores."""
    classes: NDArray[np.int64]
    """(N) class numbers."""

    def where(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> Boxes:
        """Some of the detections."""
        return Boxes(self.edges[chosen], self.scores[chosen], self.classes[chosen])


def format_of(outputs: Mapping[str, NDArray[np.generic]], size: tuple[int, int], classes: int | None) -> str:
    """The format by the shapes; ``classes``: number of classes if known. DetectorError with the candidates."""
    shapes = [array.shape for array in outputs.values()]
    candidates = _candidates(shapes, size, classes)
    if len(candidates) == 1:
        return candidates[0]
    shown = " and ".join("x".join(map(str, shape)) for shape in shapes)
    what = f"may be {' or '.join(candidates)}" if candidates else "is of no known format"
    accepted = " | ".join(candidates or ("yolov5", "yolov8", "yolox", "yolov10", "rtdetr", "nms7", "ssd"))
    raise DetectorError(f"an output of {shown} {what}; set [vision] model_format = {accepted}")


def _candidates(shapes: Sequence[tuple[int, ...]], size: tuple[int, int], classes: int | None) -> tuple[str, ...]:
    if len(shapes) >= 3:
        return ("ssd",) if any(len(shape) == 3 and shape[2] == 4 for shape in shapes) else ()
    if len(shapes) != 1:
        return ()
    shape = shapes[0]
    if len(shape) == 2 and shape[1] == 7:
        return ("nms7",)
    if len(shape) != 3 or shape[0] != 1:
        return ()
    rows, columns = shape[1:]
    if rows < columns:
        return ("yolov8",) if rows > 4 and (classes is None or rows == 4 + classes) else ()
    cells_count = sum((size[0] // stride) * (size[1] // stride) for stride in STRIDES)
    if rows > MOST_QUERIES or rows in (cells_count, ANCHORS * cells_count):
        return _by_cells(rows, columns, cells_count, classes)
    found = ["yolov10"] if columns == 6 else []
    if columns > 4 and (classes is None or columns == 4 + classes):
        found.append("rtdetr")
    return tuple(found)


def _by_cells(rows: int, columns: int, cells_count: int, classes: int | None) -> tuple[str, ...]:
    """Candidates by the number of boxes: YOLOX's raw head resembles YOLOv6's boxes; v5 and v7 have three a cell."""
    if columns <= 5 or (classes is not None and columns != 5 + classes):
        return ()
    return ("yolov5",) if rows == ANCHORS * cells_count else ("yolov5", "yolox")


def boxes_of(outputs: Mapping[str, NDArray[np.generic]], model_format: str, size: tuple[int, int]) -> Boxes:
    """The detections in a model's outputs. DetectorError where their shapes do not fit the format."""
    try:
        if model_format == "ssd":
            return _ssd(outputs, size)
        (array,) = outputs.values()
        return _OF_FORMAT[model_format](np.asarray(array, np.float64), size)
    except (ValueError, IndexError, StopIteration):
        shown = " and ".join("x".join(map(str, array.shape)) for array in outputs.values())
        raise DetectorError(f'an output of {shown} does not fit [vision] model_format = "{model_format}"') from None


def _with_objectness(rows: Array, size: tuple[int, int]) -> Boxes:  # noqa: ARG001
    (rows,) = rows
    classes = rows[:, 5:].argmax(axis=1)
    return Boxes(_edges(rows[:, :4]), rows[:, 4] * rows[np.arange(len(rows)), 5 + classes], classes)


def _yolov8(rows: Array, size: tuple[int, int]) -> Boxes:  # noqa: ARG001
    (columns,) = rows
    return _by_classes(columns.T, _edges(columns.T[:, :4]))


def _yolox(rows: Array, size: tuple[int, int]) -> Boxes:
    grids = [
        np.stack([*np.meshgrid(np.arange(size[0] // s), np.arange(size[1] // s)), np.full(cells(size, s), s)], -1)
        for s in STRIDES
    ]
    place = np.concatenate([grid.reshape(-1, 3) for grid in grids]).astype(np.float64)
    decoded, stride = rows.copy(), place[:, 2:]
    decoded[0, :, :2] = (rows[0, :, :2] + place[:, :2]) * stride
    with np.errstate(over="ignore"):
        decoded[0, :, 2:4] = np.exp(rows[0, :, 2:4]) * stride
    return _with_objectness(decoded, size)


def cells(size: tuple[int, int], stride: int) -> tuple[int, int]:
    """Rows and columns of the cells of a stride."""
    return (size[1] // stride, size[0] // stride)


def _yolov10(rows: Array, size: tuple[int, int]) -> Boxes:  # noqa: ARG001
    (rows,) = rows
    if rows.shape[1] != 6:
        raise ValueError
    return Boxes(rows[:, :4], rows[:, 4], _whole(rows[:, 5]))


def _rtdetr(rows: Array, size: tuple[int, int]) -> Boxes:
    (rows,) = rows
    return _by_classes(rows, _edges(rows[:, :4]) * np.array(size * 2))


def _nms7(rows: Array, size: tuple[int, int]) -> Boxes:  # noqa: ARG001
    if rows.ndim != 2 or rows.shape[1] != 7:
        raise ValueError
    return Boxes(rows[:, 1:5], rows[:, 6], _whole(rows[:, 5]))


def _ssd(outputs: Mapping[str, NDArray[np.generic]], size: tuple[int, int]) -> Boxes:
    """Boxes of an SSD: TensorFlow's are top, left, bottom, right, classes from 1; others' left, top, right, bottom."""
    boxes = next(np.asarray(array, np.float64)[0] for array in outputs.values() if array.ndim == 3)
    if boxes.shape[1] != 4:
        raise ValueError
    scores = next(np.asarray(array, np.float64)[0] for name, array in outputs.items() if "score" in name)
    classes = next(_whole(array[0]) for name, array in outputs.items() if "class" in name or "label" in name)
    if any(name.startswith("detection_boxes") for name in outputs):
        boxes, classes = boxes[:, [1, 0, 3, 2]], classes - 1
    if not len(boxes) == len(scores) == len(classes):
        raise ValueError
    return Boxes(boxes * np.array(size * 2), scores, classes)


_OF_FORMAT = {
    "yolov5": _with_objectness,
    "yolov8": _yolov8,
    "yolox": _yolox,
    "yolov10": _yolov10,
    "rtdetr": _rtdetr,
    "nms7": _nms7,
}


def _by_classes(rows: Array, edges: Array) -> Boxes:
    classes = rows[:, 4:].argmax(axis=1)
    return Boxes(edges, rows[np.arange(len(rows)), 4 + classes], classes)


def _edges(centred: Array) -> Array:
    """Left, top, right, bottom of centre, width and height."""
    half = 0.5 * centred[:, 2:4]
    return np.concatenate([centred[:, :2] - half, centred[:, :2] + half], axis=1)


def _whole(numbers: NDArray[np.generic]) -> NDArray[np.int64]:
    """Class numbers as integers; -1 where they are not finite."""
    floats = np.asarray(numbers, np.float64)
    return np.where(np.isfinite(floats), floats, -1.0).astype(np.int64)


def suppressed(boxes: Boxes, iou: float, most: int) -> Boxes:
    """The best boxes, the best first, such that no two of one class overlap by more than ``iou``."""
    order = np.argsort(-boxes.scores, kind="stable")
    kept: list[int] = []
    left, top, right, bottom = boxes.edges.T
    areas = np.maximum(0.0, right - left) * np.maximum(0.0, bottom - top)
    while len(order) and len(kept) < most:
        best, order = int(order[0]), order[1:]
        kept.append(best)
        across = np.minimum(right[order], right[best]) - np.maximum(left[order], left[best])
        along = np.minimum(bottom[order], bottom[best]) - np.maximum(top[order], top[best])
        common = np.maximum(0.0, across) * np.maximum(0.0, along)
        overlap = common > iou * (areas[order] + areas[best] - common)
        order = order[~(overlap & (boxes.classes[order] == boxes.classes[best]))]
    return boxes.where(np.array(kept, np.intp))
