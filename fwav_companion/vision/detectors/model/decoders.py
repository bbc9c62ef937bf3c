"""Decoders: boxes, scores and classes from the outputs of each layout.

Each takes the outputs and the reading, and returns boxes in edge coordinates of the model's input. A decoder raises
ValueError, IndexError or KeyError where the shapes are not its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fwav_companion.vision.detectors.model.boxes import Array, Boxes, corners_of_turned, edges_of_centred, hulls
from fwav_companion.vision.detectors.model.facts import STRIDES, ModelFacts, Outputs
from fwav_companion.vision.detectors.model.families import Background

MASK_WEIGHTS: Final = 32
"""Prototypes of the masks of Ultralytics' segmentation models."""
COCO_POINTS: Final = 17
ANKLES: Final = (15, 16)
"""Left and right ankle of COCO's 17 keypoints."""
CONFIDENT: Final = 0.5
"""Least probability of a keypoint that is used."""
LARGEST_SHARE: Final = 1.5
"""Largest coordinate of a box as a share of the input: boxes may end a little beyond it. In pixels no box is smaller
than this."""


@dataclass(frozen=True)
class Reading:
    """How the outputs of one model are read."""

    facts: ModelFacts
    background: Background
    activation: Literal["none", "sigmoid", "softmax"] = "none"
    """Function from the model's class outputs to scores."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the input."""
        return self.facts.size


def objectness_rows(outputs: Outputs, reading: Reading) -> Boxes:
    """YOLOv5, v6, v7: (1, N, 5 + C) cx, cy, w, h, objectness, classes."""
    rows = only_array(outputs, 3)
    require_classes(rows.shape[1] - 5, reading)
    return _with_objectness(rows)


def yolox_rows(outputs: Outputs, reading: Reading) -> Boxes:
    """YOLOX: (1, N, 5 + C), decoded, or raw: cx, cy, log w, log h in cells of strides 8, 16, 32."""
    rows = only_array(outputs, 3)
    require_classes(rows.shape[1] - 5, reading)
    return _with_objectness(_decoded_cells(rows, reading.size) if is_undecoded(rows, reading.size) else rows)


def is_undecoded(rows: Array, size: tuple[int, int]) -> bool:
    """Whether box centres count cells: decoded ones reach the last column of the input, each cell near its own."""
    centres = rows[np.isfinite(rows[:, :2]).all(axis=1), :2]
    return bool(len(centres) and np.abs(centres).max() < 0.25 * min(size))


def _decoded_cells(rows: Array, size: tuple[int, int]) -> Array:
    grids = [
        np.stack(
            [*np.meshgrid(np.arange(size[0] // s), np.arange(size[1] // s)), np.full((size[1] // s, size[0] // s), s)],
            -1,
        )
        for s in STRIDES
    ]
    place = np.concatenate([grid.reshape(-1, 3) for grid in grids]).astype(np.float64)
    decoded, stride = rows.copy(), place[:, 2:]
    decoded[:, :2] = (rows[:, :2] + place[:, :2]) * stride
    with np.errstate(over="ignore"):
        decoded[:, 2:4] = np.exp(rows[:, 2:4]) * stride
    return decoded


def class_columns(outputs: Outputs, reading: Reading) -> Boxes:
    """YOLOv8, v9, 11, 12, 26: (1, 4 + C + extra, N); extra: keypoints, 32 weights of masks, or an angle."""
    rows = _detections(outputs)
    rows = rows.T if len(rows) < rows.shape[1] else rows
    extra = extra_columns(rows.shape[1] - 4, reading)
    classes = rows.shape[1] - 4 - extra
    if classes < 1:
        raise ValueError
    chosen = rows[:, 4 : 4 + classes].argmax(axis=1)
    scores = rows[np.arange(len(rows)), 4 + chosen]
    return _with_extra(rows[:, :4], scores, chosen, rows[:, 4 + classes :], reading)


def extra_columns(columns: int, reading: Reading) -> int:
    """Number of columns after the classes; ``columns``: those after the box."""
    facts = reading.facts
    if facts.task == "pose" and facts.keypoints is not None:
        return facts.keypoints[0] * facts.keypoints[1]
    by_task = {"segment": MASK_WEIGHTS, "obb": 1, "detect": 0}.get(facts.task)
    if by_task is not None:
        return by_task
    return 0 if facts.classes is None else columns - facts.classes


def end_to_end_rows(outputs: Outputs, reading: Reading) -> Boxes:
    """YOLOv10, 26 and exports with suppression: (1, N, 6 + extra) left, top, right, bottom, score, class, extra."""
    rows = _detections(outputs)
    extra = rows.shape[1] - 6
    if extra < 0:
        raise ValueError
    if extra == 1:
        return _turned_end_to_end(rows)
    return _with_extra(rows[:, :4], rows[:, 4], whole(rows[:, 5]), rows[:, 6:], reading, centred=False)


def _turned_end_to_end(rows: Array) -> Boxes:
    """cx, cy, w, h, then score, class, angle; or angle, score, class: the class is the column of whole numbers."""
    score, number, angle = (4, 5, 6) if _are_whole(rows[:, 5]) else (5, 6, 4)
    if not _are_whole(rows[:, number]):
        raise ValueError
    outlines = corners_of_turned(rows[:, :4], rows[:, angle])
    return Boxes(hulls(outlines), rows[:, score], whole(rows[:, number]), outlines)


def detr_rows(outputs: Outputs, reading: Reading) -> Boxes:
    """RT-DETR of Ultralytics: (1, N, 4 + C) cx, cy, w, h in shares, classes."""
    rows = only_array(outputs, 3)
    if rows.shape[1] < 5:
        raise ValueError
    require_classes(rows.shape[1] - 4, reading)
    chosen = rows[:, 4:].argmax(axis=1)
    return Boxes(
        edges_of_centred(rows[:, :4]) * np.array(reading.size * 2), rows[np.arange(len(rows)), 4 + chosen], chosen
    )


def nms7_rows(outputs: Outputs, reading: Reading) -> Boxes:  # noqa: ARG001
    """YOLOv7 with suppression: (N, 7) image, left, top, right, bottom, class, score."""
    rows = _flat_rows(outputs)
    return Boxes(rows[:, 1:5], rows[:, 6], whole(rows[:, 5]))


def yolonas_rows(outputs: Outputs, reading: Reading) -> Boxes:  # noqa: ARG001
    """YOLO-NAS, flat: (N, 7) image, left, top, right, bottom, score, class."""
    rows = _flat_rows(outputs)
    return Boxes(rows[:, 1:5], rows[:, 5], whole(rows[:, 6]))


def yolonas_raw(outputs: Outputs, reading: Reading) -> Boxes:
    """YOLO-NAS without suppression: boxes (1, N, 4) in pixels, scores (1, N, C)."""
    boxes, scores = (first_of_batch(array) for array in outputs.values())
    if boxes.shape[1] != 4 and scores.shape[1] == 4:
        boxes, scores = scores, boxes
    if boxes.shape[1] != 4 or len(boxes) != len(scores):
        raise ValueError
    require_classes(scores.shape[1], reading)
    chosen = scores.argmax(axis=1)
    return Boxes(boxes, scores[np.arange(len(scores)), chosen], chosen)


def whole(numbers: NDArray[np.generic]) -> NDArray[np.int64]:
    """Class numbers as integers; -1 where they are not finite."""
    floats = np.asarray(numbers, np.float64)
    return np.where(np.isfinite(floats), floats, -1.0).astype(np.int64)


def _are_whole(numbers: Array) -> bool:
    return bool((numbers == np.round(numbers)).all())


def first_of_batch(array: NDArray[np.generic]) -> Array:
    """The first of a batch."""
    first: Array = np.asarray(array, np.float64)[0]
    return first


def only_array(outputs: Outputs, rank: int) -> Array:
    """The first of the batch of the only output. ValueError unless there is one, of this rank and a batch of one."""
    (array,) = outputs.values()
    if array.ndim != rank or array.shape[0] != 1:
        raise ValueError
    return first_of_batch(array)


def _detections(outputs: Outputs) -> Array:
    """The rows of a model that may have prototypes of masks as a second output."""
    (array,) = (array for array in outputs.values() if array.ndim == 3)
    if array.shape[0] != 1 or len(outputs) > 2:
        raise ValueError
    return first_of_batch(array)


def _flat_rows(outputs: Outputs) -> Array:
    rows = only_array({name: array[None] for name, array in outputs.items()}, 3)
    if rows.shape[1] != 7:
        raise ValueError
    return rows


def require_classes(number: int, reading: Reading) -> None:
    """ValueError unless this may be the number of classes."""
    if number < 1 or reading.facts.classes not in (None, number):
        raise ValueError


def _with_objectness(rows: Array) -> Boxes:
    classes = rows[:, 5:].argmax(axis=1)
    return Boxes(edges_of_centred(rows[:, :4]), rows[:, 4] * rows[np.arange(len(rows)), 5 + classes], classes)


def _with_extra(
    box: Array, scores: Array, classes: NDArray[np.int64], extra: Array, reading: Reading, *, centred: bool = True
) -> Boxes:
    """Boxes with what stands behind their classes."""
    columns, keypoints = extra.shape[1], reading.facts.keypoints
    edges = edges_of_centred(box) if centred else box
    if columns == 0:
        return Boxes(edges, scores, classes)
    if columns == 1 and centred:
        outlines = corners_of_turned(box, extra[:, 0])
        return Boxes(hulls(outlines), scores, classes, outlines)
    if columns == MASK_WEIGHTS:
        return Boxes(edges, scores, classes, coefficients=extra)
    keypoints = keypoints or ((COCO_POINTS, 3) if columns == 3 * COCO_POINTS else None)
    if keypoints is None or columns != keypoints[0] * keypoints[1]:
        raise ValueError
    return Boxes(edges, scores, classes, feet=_feet(extra.reshape(-1, *keypoints)))


def _feet(points: Array) -> Array | None:
    """(N, 2) midpoints of the confident ankles of (N, 17, 3) keypoints, NaN where none is."""
    if points.shape[1:] != (COCO_POINTS, 3):
        return None
    ankles = points[:, list(ANKLES)]  # (N, 2, 3)
    weights = (ankles[:, :, 2] >= CONFIDENT).astype(np.float64)[:, :, None]
    with np.errstate(invalid="ignore"):
        feet: Array = (ankles[:, :, :2] * weights).sum(axis=1) / weights.sum(axis=1)
    return feet


def are_shares(boxes: Array) -> bool:
    """Whether no coordinate exceeds that of a share of the input."""
    finite = boxes[np.isfinite(boxes)]
    return bool(not len(finite) or np.abs(finite).max() <= LARGEST_SHARE)
