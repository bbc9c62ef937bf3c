"""Recognizes the layout of a model: never guessed, by metadata, names, types, shapes, then the values of outputs.

The order of the evidence: the exporter's metadata, names and types of the inputs, names, types and shapes of the
outputs (``layouts``), then values of the first outputs (here). What remains open is asked, with the candidates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from fwav_companion.vision.detectors.model.boxes import Array
from fwav_companion.vision.detectors.model.decoders import Reading, are_shares, is_undecoded
from fwav_companion.vision.detectors.model.facts import ModelFacts, Outputs, shown
from fwav_companion.vision.detectors.model.families import FAMILIES, Background
from fwav_companion.vision.detectors.model.layouts import LAYOUTS, Layout, layouts_of
from fwav_companion.vision.images import DetectorError

NANODET_STRIDES: Final = (8, 16, 32, 64)
NANODET_ADVICE: Final = (
    ": its boxes are distributions over distances; add its decoding to the graph and export boxes, scores and labels, "
    "or send its own detections to [detections] url"
)
OFFICIAL_RFDETR_CLASSES: Final = 91
"""Class slots of RF-DETR's own weights: COCO's numbers with their gaps, without a background."""
BACKGROUND_LABELS: Final = ("background", "__background__", "bg")


@dataclass(frozen=True)
class Open:
    """Layouts that outputs without a detection do not tell apart; those of a picture with one do."""

    candidates: tuple[Layout, ...]
    message: str
    """The question, for the case that no picture answers it."""


def recognized(model_format: str, facts: ModelFacts, outputs: Outputs) -> Layout | Open:
    """The layout of these outputs. DetectorError where no layout fits or where only the user can know."""
    if model_format != "auto":
        return _configured(model_format, facts, outputs)
    exotic = _refused_by_name(facts, outputs)
    if exotic:
        raise DetectorError(exotic)
    found = [layout for layout in LAYOUTS if layout.matches(facts, outputs)]
    if not found:
        raise DetectorError(_unknown(facts, outputs))
    if len(found) == 1:
        _require_scores(found[0], facts, outputs)
        return found[0]
    return _by_evidence(found, facts, outputs)


def _configured(model_format: str, facts: ModelFacts, outputs: Outputs) -> Layout:
    layouts = layouts_of(model_format)
    matching = [layout for layout in layouts if layout.matches(facts, outputs)]
    for layout in (*matching, *layouts):
        try:
            layout.decode(outputs, Reading(facts, layout.family.background, layout.activation))
        except (ValueError, IndexError, KeyError, StopIteration):
            continue
        return layout
    raise DetectorError(f'its outputs ({shown(outputs)}) do not fit [vision] model_format = "{model_format}"')


def _require_scores(layout: Layout, facts: ModelFacts, outputs: Outputs) -> None:
    """Refuse class columns that are no scores, where the number of classes is not known: keypoints or angles follow."""
    if layout.family.name != "yolov8" or facts.classes is not None or facts.task:
        return
    rows = np.asarray(next(array for array in outputs.values() if array.ndim == 3), np.float64)[0]
    others = rows[4:] if len(rows) < rows.shape[1] else rows[:, 4:]
    if others.min() < 0.0 or others.max() > 1.0:
        worst = others.max() if others.max() > 1.0 else others.min()
        raise DetectorError(
            f"scores {'up' if worst > 1.0 else 'down'} to {worst:.3g}: keypoints, angles or masks follow the classes, "
            "and the file does not say how many classes it has; set [vision] model_labels, or export with metadata, as "
            "Ultralytics' export does"
        )


def _by_evidence(found: Sequence[Layout], facts: ModelFacts, outputs: Outputs) -> Layout | Open:
    """The one of several layouts of the same shape that metadata or values confirm."""
    by_family = {layout.family.name: layout for layout in found}
    families = set(by_family)
    array = next(iter(outputs.values()))
    if families == {"yolov10", "rtdetr"}:
        chosen = _end_to_end_or_detr(facts, np.asarray(array, np.float64))
        question = "boxes in shares of the input: rtdetr; in pixels, with the class as the sixth number: yolov10"
        return by_family.get(chosen) or Open(tuple(found), _asked(found, outputs, question))
    if families == {"nms7", "yolonas"}:
        chosen = _class_column(np.asarray(array, np.float64))
        question = "score before class: yolonas; class before score: nms7"
        return by_family.get(chosen) or Open(tuple(found), _asked(found, outputs, question))
    if families == {"yolov5", "yolox"}:
        if is_undecoded(np.asarray(array, np.float64)[0], facts.size):
            return by_family["yolox"]
        if facts.writes_stride_and_names:
            return by_family["yolov5"]
        raise DetectorError(_asked(found, outputs, "made with YOLOX (blue first, 0 to 255): yolox; else yolov5"))
    if families == {"rtdetr", "detr"}:
        raise DetectorError(
            _asked(
                found, outputs, "RT-DETR or D-FINE: rtdetr; DETR (its last class is no object): detr; or model_labels"
            )
        )
    raise DetectorError(_asked(found, outputs, "how the file was exported decides"))


def _end_to_end_or_detr(facts: ModelFacts, rows: Array) -> str:
    """yolov10 or rtdetr; "" where every row is empty."""
    description = facts.metadata.get("description", "").lower()
    if "rtdetr" in description or "rt-detr" in description:
        return "rtdetr"
    if facts.is_ultralytics and "yolo" in description:
        return "yolov10"
    boxes = rows[0, :, :4]
    if not np.any(boxes):
        return ""
    return "rtdetr" if are_shares(boxes) else "yolov10"


def _class_column(rows: Array) -> str:
    """nms7 or yolonas by the column of whole numbers; "" where rows do not tell."""
    if not len(rows):
        return ""
    sixth, seventh = (bool((column == np.round(column)).all()) for column in (rows[:, 5], rows[:, 6]))
    if sixth == seventh:
        return ""
    return "nms7" if sixth else "yolonas"


def background_of(
    layout: Layout, wanted: Background | Literal["auto"], facts: ModelFacts, outputs: Outputs, labels: tuple[str, ...]
) -> Background:
    """The class slot that is not a class. DetectorError where only the user can know."""
    if wanted != "auto":
        return wanted
    usual = layout.family.background
    if usual == "first" and labels and labels[0].lower() in BACKGROUND_LABELS:
        return "none"  # these labels count the background too
    if layout.family is not FAMILIES["rfdetr"]:
        return usual
    slots = outputs["labels"].shape[-1]
    if facts.classes is not None and slots - facts.classes in (0, 1):
        return "none" if slots == facts.classes else "last"
    if facts.classes is None and slots == OFFICIAL_RFDETR_CLASSES:
        return "none"
    raise DetectorError(
        f"{slots} class slots, {facts.classes or 'unknown'} labels; set [vision] model_background = none | first | "
        "last (RF-DETR trained on your own classes: last), or model_labels"
    )


def _asked(found: Sequence[Layout], outputs: Outputs, question: str) -> str:
    names = list(dict.fromkeys(layout.family.name for layout in found))
    return (
        f"its outputs ({shown(outputs)}) may be {' or '.join(names)}; set [vision] model_format = {' | '.join(names)} "
        f"({question})"
    )


def _unknown(facts: ModelFacts, outputs: Outputs) -> str:
    classes = "" if facts.classes is None else f" with {facts.classes} labels"
    return (
        f"its outputs ({shown(outputs)}){classes} are of no known format; accepted: [vision] model_format = "
        + " | ".join(FAMILIES)
    )


def _refused_by_name(facts: ModelFacts, outputs: Outputs) -> str:
    """Why a known but unsupported head is refused, and what to export instead; "" for others."""
    shapes = [array.shape for array in outputs.values()]
    cells = sum(-(-facts.size[0] // stride) * -(-facts.size[1] // stride) for stride in NANODET_STRIDES)
    if len(shapes) == 1 and len(shapes[0]) == 3 and shapes[0][1] == cells:
        return f"a raw head of NanoDet-Plus (strides 8 to 64){NANODET_ADVICE}"
    if any(name.startswith("dis_pred") for name in outputs):
        return f"raw heads of NanoDet{NANODET_ADVICE}"
    if any(len(shape) == 5 for shape in shapes) or (len(shapes) == 3 and all(len(shape) == 4 for shape in shapes)):
        return "raw heads of a YOLO; export with its decoding (v5: export.py --include onnx; v7: --grid)"
    if {"regressors", "classificators"} <= outputs.keys():
        return "raw heads of MediaPipe; send its own program's detections to [detections] url"
    unnamed = "boxes" not in outputs and any(array.ndim == 2 and array.shape[1] == 4 for array in outputs.values())
    if unnamed and len(facts.inputs[0].shape) == 3:
        return (
            f"its outputs ({shown(outputs)}) have no names; a Faster R-CNN or RetinaNet of torchvision: export with "
            'output_names = ["boxes", "labels", "scores"] in their order'
        )
    return ""
