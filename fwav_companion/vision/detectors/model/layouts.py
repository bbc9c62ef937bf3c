"""Layouts: one row for each arrangement of outputs, with the family whose preset it has. PURE."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

from fwav_companion.vision.detectors.model import decoders, named_decoders
from fwav_companion.vision.detectors.model.boxes import Boxes
from fwav_companion.vision.detectors.model.decoders import COCO_POINTS, MASK_WEIGHTS, Reading
from fwav_companion.vision.detectors.model.facts import ModelFacts, Outputs
from fwav_companion.vision.detectors.model.families import CAFFE_SSD, FAMILIES, Family

MOST_QUERIES: Final = 1000
"""Most rows of outputs with suppression and of DETR's, which have some hundred; without suppression 2100 and more."""
ANCHORS: Final = 3
"""Boxes of each cell of YOLOv5 and v7; later models have one."""


@dataclass(frozen=True)
class Layout:
    """One arrangement of outputs."""

    name: str
    family: Family
    matches: Callable[[ModelFacts, Outputs], bool]
    """Whether names, types and shapes may be of this layout."""
    decode: Callable[[Outputs, Reading], Boxes]
    overlaps: bool = False
    """Whether its boxes still overlap: non-maximum suppression is ours."""
    activation: Literal["none", "sigmoid", "softmax"] = "none"


def _rows(outputs: Outputs) -> tuple[int, int]:
    """Rows and columns of the only output of rank 3, beside the prototypes of masks; (0, 0) otherwise."""
    shapes = [array.shape for array in outputs.values() if array.ndim == 3]
    if len(shapes) != 1 or shapes[0][0] != 1 or len(outputs) > 2:
        return 0, 0
    return (0, 0) if len(outputs) == 2 and not _has_prototypes(outputs) else (shapes[0][1], shapes[0][2])


def _has_prototypes(outputs: Outputs) -> bool:
    return any(array.ndim == 4 and array.shape[1] == MASK_WEIGHTS for array in outputs.values())


def _is_dense(rows: int, facts: ModelFacts) -> bool:
    return rows > MOST_QUERIES or rows in (facts.cells, ANCHORS * facts.cells)


def _fits_classes(columns: int, facts: ModelFacts) -> bool:
    return columns > 0 and facts.classes in (None, columns)


def _yolov5(facts: ModelFacts, outputs: Outputs) -> bool:
    rows, columns = _rows(outputs)
    return rows > columns and _is_dense(rows, facts) and _fits_classes(columns - 5, facts) and len(outputs) == 1


def _yolox(facts: ModelFacts, outputs: Outputs) -> bool:
    rows, _ = _rows(outputs)
    return _yolov5(facts, outputs) and rows != ANCHORS * facts.cells and not facts.is_ultralytics


def _yolov8(facts: ModelFacts, outputs: Outputs) -> bool:
    rows, columns = _rows(outputs)
    if 4 < columns < rows and _is_dense(rows, facts):  # transposed by some exporters
        return facts.classes == columns - 4 and len(outputs) == 1
    return 4 < rows < columns and _fits_extra(rows - 4, facts, outputs)


def _fits_extra(columns: int, facts: ModelFacts, outputs: Outputs) -> bool:
    """Whether classes and what follows them fill these columns."""
    if facts.task == "pose" and facts.keypoints is None:
        return False
    extra = MASK_WEIGHTS if _has_prototypes(outputs) else 0
    if facts.task:
        extra = decoders.extra_columns(columns, Reading(facts, "none"))
        return extra < columns and _fits_classes(columns - extra, facts)
    known = (extra,) if extra else (0, 1, 3 * COCO_POINTS)
    return facts.classes is None or columns - facts.classes in known


def _end_to_end(facts: ModelFacts, outputs: Outputs) -> bool:
    rows, columns = _rows(outputs)
    if not 0 < rows <= MOST_QUERIES or columns < 6:
        return False
    by_task = {"obb": 1, "segment": MASK_WEIGHTS, "detect": 0}.get(facts.task)
    if facts.task == "pose" and facts.keypoints is not None:
        by_task = facts.keypoints[0] * facts.keypoints[1]
    known = (0, MASK_WEIGHTS if _has_prototypes(outputs) else 0, 3 * COCO_POINTS) if by_task is None else (by_task,)
    return columns - 6 in known and (rows > columns or columns - 6 == by_task)


def _detr_rows(facts: ModelFacts, outputs: Outputs) -> bool:
    rows, columns = _rows(outputs)
    few = columns < rows <= MOST_QUERIES and not _is_dense(rows, facts)
    return few and len(outputs) == 1 and _fits_classes(columns - 4, facts) and facts.metadata.get("end2end") != "True"


def _seven(facts: ModelFacts, outputs: Outputs) -> bool:  # noqa: ARG001
    return len(outputs) == 1 and all(array.ndim == 2 and array.shape[1] == 7 for array in outputs.values())


def _yolonas_flat(facts: ModelFacts, outputs: Outputs) -> bool:
    return _seven(facts, outputs)


def _nms7(facts: ModelFacts, outputs: Outputs) -> bool:
    return _seven(facts, outputs) and not any(name.startswith("graph2_") for name in outputs)


def _yolonas_batch(facts: ModelFacts, outputs: Outputs) -> bool:  # noqa: ARG001
    ends = ("num_predictions", "pred_boxes", "pred_scores", "pred_classes")
    return len(outputs) == len(ends) and all(any(name.endswith(end) for name in outputs) for end in ends)


def _yolonas_raw(facts: ModelFacts, outputs: Outputs) -> bool:
    shapes = [array.shape for array in outputs.values()]
    if len(shapes) != 2 or any(len(shape) != 3 for shape in shapes) or shapes[0][1] != shapes[1][1]:
        return False
    columns = sorted(shape[2] for shape in shapes)
    wide = columns[1] if columns[0] == 4 else columns[0]
    return 4 in columns and _is_dense(shapes[0][1], facts) and _fits_classes(wide, facts)


def _named_ranks(outputs: Outputs, *names: str) -> tuple[int, ...]:
    """Ranks of the outputs of exactly these names; () where the names are others."""
    plain = {name.split(":")[0]: array.ndim for name, array in outputs.items()}
    return tuple(plain[name] for name in names) if set(plain) == set(names) else ()


def _detr_boxes(facts: ModelFacts, outputs: Outputs) -> bool:  # noqa: ARG001
    return _named_ranks(outputs, "boxes", "labels", "scores") == (3, 2, 2)


def _rtdetr_logits(facts: ModelFacts, outputs: Outputs) -> bool:
    if "pixel_mask" in facts.input_names:
        return False
    return _logits(outputs) and facts.classes in (None, _logits_columns(outputs))


def _detr(facts: ModelFacts, outputs: Outputs) -> bool:
    if "orig_target_sizes" in facts.input_names:
        return False
    return _logits(outputs) and facts.classes in (None, _logits_columns(outputs) - 1)


def _logits(outputs: Outputs) -> bool:
    named = "pred_boxes" in outputs and not outputs.keys().isdisjoint(("logits", "pred_logits"))
    return named and outputs["pred_boxes"].ndim == 3 and outputs["pred_boxes"].shape[2] == 4


def _logits_columns(outputs: Outputs) -> int:
    return next((array.shape[-1] for name, array in outputs.items() if "logits" in name), 0)


def _dets_columns(outputs: Outputs) -> int:
    dets, labels = outputs.get("dets"), outputs.get("labels")
    return dets.shape[2] if dets is not None and labels is not None and dets.ndim == 3 else 0


def _rfdetr(facts: ModelFacts, outputs: Outputs) -> bool:  # noqa: ARG001
    return _dets_columns(outputs) == 4 and outputs["labels"].dtype.kind == "f"


def _mmdeploy(facts: ModelFacts, outputs: Outputs) -> bool:  # noqa: ARG001
    return _dets_columns(outputs) == 5 and outputs["labels"].dtype.kind == "i"


def _paddle(facts: ModelFacts, outputs: Outputs) -> bool:
    rows = [array for array in outputs.values() if array.ndim == 2 and array.shape[1] == 6]
    named = any(name.startswith("multiclass_nms") for name in outputs)
    return len(rows) == 1 and (named or "scale_factor" in facts.input_names)


def _torchvision(facts: ModelFacts, outputs: Outputs) -> bool:  # noqa: ARG001
    return _named_ranks(outputs, "boxes", "labels", "scores") == (2, 1, 1)


def _tensorflow(facts: ModelFacts, outputs: Outputs) -> bool:  # noqa: ARG001
    names = {name.split(":")[0] for name in outputs}
    return {"detection_boxes", "detection_scores", "detection_classes"} <= names


def _efficientdet(facts: ModelFacts, outputs: Outputs) -> bool:
    return facts.inputs[0].name.startswith("image_arrays") and _rows(outputs)[1] == 7


def _ssd(facts: ModelFacts, outputs: Outputs) -> bool:  # noqa: ARG001
    return _named_ranks(outputs, "bboxes", "labels", "scores") == (3, 2, 2)


def _openvino(facts: ModelFacts, outputs: Outputs) -> bool:  # noqa: ARG001
    shapes = [array.shape for array in outputs.values()]
    return len(shapes) == 1 and len(shapes[0]) == 4 and shapes[0][:2] == (1, 1) and shapes[0][3] == 7


LAYOUTS: Final = (
    Layout("YOLOv5, v6, v7", FAMILIES["yolov5"], _yolov5, decoders.objectness_rows, overlaps=True),
    Layout("YOLOv8, v9, 11, 12", FAMILIES["yolov8"], _yolov8, decoders.class_columns, overlaps=True),
    Layout("YOLOX", FAMILIES["yolox"], _yolox, decoders.yolox_rows, overlaps=True),
    Layout("YOLOv10, 26, end to end", FAMILIES["yolov10"], _end_to_end, decoders.end_to_end_rows),
    Layout("YOLO-NAS flat", FAMILIES["yolonas"], _yolonas_flat, decoders.yolonas_rows),
    Layout("YOLO-NAS batch", FAMILIES["yolonas"], _yolonas_batch, named_decoders.yolonas_batch),
    Layout("YOLO-NAS raw", FAMILIES["yolonas"], _yolonas_raw, decoders.yolonas_raw, overlaps=True),
    Layout("RT-DETR of Ultralytics", FAMILIES["rtdetr"], _detr_rows, decoders.detr_rows),
    Layout("RT-DETR, D-FINE, DEIM", FAMILIES["rtdetr"], _detr_boxes, named_decoders.named_boxes),
    Layout(
        "RT-DETR, D-FINE raw",
        FAMILIES["rtdetr"],
        _rtdetr_logits,
        named_decoders.logits_and_boxes,
        activation="sigmoid",
    ),
    Layout("RF-DETR", FAMILIES["rfdetr"], _rfdetr, named_decoders.logits_and_boxes, activation="sigmoid"),
    Layout("DETR", FAMILIES["detr"], _detr, named_decoders.logits_and_boxes, activation="softmax"),
    Layout("mmdeploy", FAMILIES["mmdeploy"], _mmdeploy, named_decoders.mmdeploy_boxes),
    Layout("PP-YOLOE, PicoDet", FAMILIES["paddle"], _paddle, named_decoders.paddle_rows),
    Layout("torchvision", FAMILIES["torchvision"], _torchvision, named_decoders.named_boxes),
    Layout("TensorFlow zoo", FAMILIES["tf"], _tensorflow, named_decoders.tensorflow_boxes),
    Layout("EfficientDet of automl", FAMILIES["tf"], _efficientdet, named_decoders.efficientdet_rows),
    Layout("YOLOv7 with suppression", FAMILIES["nms7"], _nms7, decoders.nms7_rows),
    Layout("SSD of MLPerf", FAMILIES["ssd"], _ssd, named_decoders.named_boxes),
    Layout("SSD of OpenVINO", CAFFE_SSD, _openvino, named_decoders.openvino_rows),
)
SAME_FAMILY: Final = {"dfine": "rtdetr"}
"""Values of model_format that are read alike."""


def layouts_of(model_format: str) -> tuple[Layout, ...]:
    """The layouts of a configured model_format; ``auto``: all."""
    name = SAME_FAMILY.get(model_format, model_format)
    return tuple(layout for layout in LAYOUTS if name in ("auto", layout.family.name))
