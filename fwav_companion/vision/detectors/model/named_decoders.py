"""Decoders of outputs with names or types of their own: DETR's kin, TensorFlow, torchvision, mmdeploy, Paddle, SSD.

As in ``decoders``, each returns boxes in edge coordinates of the input, and raises ValueError, IndexError or KeyError.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fwav_companion.vision.detectors.model.boxes import Array, Boxes, edges_of_centred
from fwav_companion.vision.detectors.model.decoders import Reading, are_shares, first_of_batch, only_array, whole
from fwav_companion.vision.detectors.model.facts import Outputs
from fwav_companion.vision.detectors.model.families import Background


def logits_and_boxes(outputs: Outputs, reading: Reading) -> Boxes:
    """DETR and its kin: class outputs (1, Q, C) and boxes (1, Q, 4) cx, cy, w, h in shares."""
    boxes_name = next(name for name in ("pred_boxes", "dets", "boxes") if name in outputs)
    logits_name = next(name for name in ("pred_logits", "logits", "labels") if name in outputs)
    boxes, logits = first_of_batch(outputs[boxes_name]), first_of_batch(outputs[logits_name])
    if boxes.shape[1] != 4 or len(boxes) != len(logits):
        raise ValueError
    scores = _activated(logits, reading.activation)
    if reading.background != "none":
        scores = scores[:, 1:] if reading.background == "first" else scores[:, :-1]
    chosen = scores.argmax(axis=1)
    return Boxes(edges_of_centred(boxes) * np.array(reading.size * 2), scores[np.arange(len(scores)), chosen], chosen)


def named_boxes(outputs: Outputs, reading: Reading) -> Boxes:
    """Boxes (1, N, 4) or (N, 4) left, top, right, bottom, with labels and scores, by their names; pixels or shares."""
    boxes, scores, labels = (named(outputs, key) for key in ("boxes", "scores", "labels"))
    if boxes.ndim != 2 or boxes.shape[1] != 4 or not len(boxes) == len(scores) == len(labels):
        raise ValueError
    return Boxes(_in_pixels(boxes, reading.size), scores, _numbered(labels, reading.background))


def tensorflow_boxes(outputs: Outputs, reading: Reading) -> Boxes:
    """detection_boxes (1, N, 4) top, left, bottom, right in shares, detection_scores and detection_classes."""
    boxes, scores, classes = (
        first_of_batch(outputs[name])
        for name in (named_like(outputs, f"detection_{key}") for key in ("boxes", "scores", "classes"))
    )
    if boxes.shape[1] != 4 or not len(boxes) == len(scores) == len(classes):
        raise ValueError
    return Boxes(_in_pixels(boxes[:, [1, 0, 3, 2]], reading.size), scores, _numbered(classes, reading.background))


def efficientdet_rows(outputs: Outputs, reading: Reading) -> Boxes:
    """EfficientDet of automl: (1, N, 7) image, top, left, bottom, right in pixels, score, class."""
    rows = only_array(outputs, 3)
    if rows.shape[1] != 7:
        raise ValueError
    return Boxes(rows[:, [2, 1, 4, 3]], rows[:, 5], _numbered(rows[:, 6], reading.background))


def openvino_rows(outputs: Outputs, reading: Reading) -> Boxes:
    """SSD of Caffe and OpenVINO: (1, 1, N, 7) image, class, score, left, top, right, bottom in shares."""
    rows = np.asarray(next(iter(outputs.values())), np.float64)[0, 0]
    if rows.shape[1] != 7:
        raise ValueError
    used = np.where(rows[:, 0] >= 0.0, rows[:, 1], -1.0)  # image -1 ends the list
    return Boxes(_in_pixels(rows[:, 3:7], reading.size), rows[:, 2], _numbered(used, reading.background))


def yolonas_batch(outputs: Outputs, reading: Reading) -> Boxes:  # noqa: ARG001
    """YOLO-NAS, batch: num_predictions (1, 1), pred_boxes (1, K, 4), pred_scores and pred_classes (1, K)."""
    boxes, scores, classes = (
        first_of_batch(outputs[named_like(outputs, key)]) for key in ("pred_boxes", "pred_scores", "pred_classes")
    )
    count = int(np.ravel(outputs[named_like(outputs, "num_predictions")])[0])
    return Boxes(boxes[:count], scores[:count], whole(classes[:count]))


def mmdeploy_boxes(outputs: Outputs, reading: Reading) -> Boxes:  # noqa: ARG001
    """mmdeploy: dets (1, N, 5) left, top, right, bottom, score in pixels, labels (1, N) whole numbers."""
    dets, labels = first_of_batch(outputs["dets"]), first_of_batch(outputs["labels"])
    if dets.shape[1] != 5 or len(dets) != len(labels):
        raise ValueError
    return Boxes(dets[:, :4], dets[:, 4], whole(labels))


def paddle_rows(outputs: Outputs, reading: Reading) -> Boxes:  # noqa: ARG001
    """PaddleDetection: (N, 6) class, score, left, top, right, bottom in pixels, and the number of rows that count."""
    rows = next(np.asarray(array, np.float64) for array in outputs.values() if array.ndim == 2 and array.shape[1] == 6)
    counts = [array for array in outputs.values() if array.ndim < 2 and array.dtype.kind in "iu"]
    rows = rows[: int(np.ravel(counts[0])[0])] if counts else rows
    return Boxes(rows[:, 2:6], rows[:, 1], whole(rows[:, 0]))


def named(outputs: Outputs, key: str) -> Array:
    """The output of this meaning without its batch: a box has four numbers, a score or a label one."""
    array = np.asarray(outputs[named_like(outputs, key)], np.float64)
    plain = 2 if key == "boxes" else 1
    found: Array = array[0] if array.ndim == plain + 1 else array
    return found


def named_like(outputs: Outputs, key: str) -> str:
    """The name of the output that ends so; KeyError without one."""
    for name in outputs:
        if name.split(":")[0].endswith(key):
            return name
    raise KeyError(key)


def _numbered(numbers: NDArray[np.generic], background: Background) -> NDArray[np.int64]:
    """Class numbers from 0; the number 0 of a background slot becomes -1."""
    return whole(numbers) - (background == "first")


def _in_pixels(boxes: Array, size: tuple[int, int]) -> Array:
    """Boxes in pixels of the input, from pixels or shares of it."""
    return boxes * np.array(size * 2) if are_shares(boxes) else boxes


def _activated(logits: Array, activation: str) -> Array:
    if activation == "softmax":
        raised = np.exp(logits - logits.max(axis=1, keepdims=True))
        share: Array = raised / raised.sum(axis=1, keepdims=True)
        return share
    with np.errstate(over="ignore"):
        sigmoid: Array = 1.0 / (1.0 + np.exp(-logits))
    return sigmoid if activation == "sigmoid" else logits
