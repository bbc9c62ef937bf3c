"""Detects objects with the user's model file, by onnxruntime.

No model comes with this package. The file's format, input and labels are found in its shapes and metadata, or set by
the configuration.
"""

from __future__ import annotations

import ast
import logging
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fwav_companion.vision.detectors.letterbox import Placing, fit
from fwav_companion.vision.detectors.model_outputs import SUPPRESSED, Boxes, boxes_of, format_of, suppressed
from fwav_companion.vision.images import DetectorError, Found, Pixels
from fwav_companion.vision.task import VisionTask
from fwav_companion.vision.wire import MAX_DETECTIONS

_log = logging.getLogger(__name__)
USUAL_SIDE = 640
"""Side of the input for models that accept any size and do not name one, pixels."""
SIGMA_OF_SIZE = 0.05
"""One sigma of a box's centre, each axis, as a share of the box's width and height. It is a rule, not a measurement:
the true sigma depends on the model and on its pictures."""
LEAST_SIGMA_PX = 1.0
MOST_CANDIDATES = 2048
"""Most boxes above the least score that enter the suppression."""
PLACINGS: Final[dict[str, Placing]] = {"yolox": "corner", "rtdetr": "stretch", "ssd": "stretch"}
"""Placing of a picture of another shape with which each format was trained; the others have margins on both sides."""
TYPES: Final = {"tensor(float)": np.float32, "tensor(float16)": np.float16, "tensor(uint8)": np.uint8}


class OnnxDetector:
    """Detector of the objects of one model."""

    def __init__(self, task: VisionTask) -> None:
        self._name = Path(task.model).name
        self._task = task
        self._session: Any = self._opened()
        self._input = _ModelInput(self._session, self._fail)
        metadata = dict(self._session.get_modelmeta().custom_metadata_map)
        self._labels = task.model_labels or _labels(metadata.get("names", ""))
        self._input.settle_size(metadata.get("imgsz", ""))
        outputs = self._run(np.full((*self._input.size[::-1], 3), 114, np.uint8))
        self._format = task.model_format if task.model_format != "auto" else self._guessed(outputs, metadata)
        self._placing: Placing = PLACINGS.get(self._format, "centre")
        self._colors = task.model_input if task.model_input != "auto" else self._input.usual_colors(self._format)
        self._input.colors = self._colors
        self._boxes(outputs)
        self._complained = False

    def detect(self, pixels: Pixels) -> list[Found]:
        """The objects, each at the centre of its box."""
        fitted, letterbox = fit(pixels, self._input.size, self._placing)
        boxes = self._boxes(self._run(fitted))
        finite = np.isfinite(boxes.edges).all(axis=1) & np.isfinite(boxes.scores)
        if not finite.all():
            self._complain(int((~finite).sum()))
        boxes = boxes.where(finite & (boxes.scores >= self._task.model_confidence) & (boxes.classes >= 0))
        boxes = boxes.where(np.argsort(-boxes.scores, kind="stable")[:MOST_CANDIDATES])
        if self._format not in SUPPRESSED:
            boxes = suppressed(boxes, self._task.model_iou, MAX_DETECTIONS)
        boxes = boxes.where(np.arange(min(len(boxes.scores), MAX_DETECTIONS)))
        height, width = pixels.shape[:2]
        edges = letterbox.picture_from_input(boxes.edges)
        edges = np.clip(edges, -0.5, [width - 0.5, height - 0.5] * 2)
        return [
            self._found(*each)
            for each in zip(edges.tolist(), boxes.scores.tolist(), boxes.classes.tolist(), strict=True)
        ]

    def _opened(self) -> Any:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = self._task.threads, 1
        options.log_severity_level = 4  # suppresses its own lines; our log reports a failure
        try:
            return onnxruntime.InferenceSession(self._task.model, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # noqa: BLE001  # onnxruntime has some ten classes without a common one
            raise self._fail(f"not a model that onnxruntime loads ({_first_line(error)})") from None

    def _run(self, fitted: Pixels) -> dict[str, NDArray[Any]]:
        names = [output.name for output in self._session.get_outputs()]
        try:
            return dict(zip(names, self._session.run(names, self._input.feed(fitted)), strict=True))
        except Exception as error:  # noqa: BLE001  # as above
            raise self._fail(f"the model failed ({_first_line(error)})") from None

    def _guessed(self, outputs: dict[str, NDArray[Any]], metadata: dict[str, str]) -> str:
        """The format; YOLOv5 writes stride and names into its files, YOLOX neither."""
        try:
            return format_of(outputs, self._input.size, len(self._labels) or None)
        except DetectorError as error:
            if "yolov5 or yolox" in str(error) and {"stride", "names"} <= metadata.keys():
                return "yolov5"
            raise self._fail(str(error)) from None

    def _boxes(self, outputs: dict[str, NDArray[Any]]) -> Boxes:
        try:
            return boxes_of(outputs, self._format, self._input.size)
        except DetectorError as error:
            raise self._fail(str(error)) from None

    def _found(self, edges: list[float], score: float, number: int) -> Found:
        left, top, right, bottom = edges
        return {
            "u": round(0.5 * (left + right), 3),
            "v": round(0.5 * (top + bottom), 3),
            "sigma": [round(max(LEAST_SIGMA_PX, SIGMA_OF_SIZE * side), 3) for side in (right - left, bottom - top)],
            "label": self._labels[number] if number < len(self._labels) else str(number),
            "score": round(min(1.0, score), 4),
            "box": [round(edge, 2) for edge in edges],
        }

    def _complain(self, number: int) -> None:
        """Log the first outputs that are not finite."""
        if not self._complained:
            self._complained = True
            _log.warning(
                "%s: %d outputs are not finite numbers: dropped, further ones without a message", self._name, number
            )

    def _fail(self, what: str) -> DetectorError:
        return DetectorError(f"[vision] model {self._name}: {what}")


class _ModelInput:
    """The one input of a model: a picture."""

    def __init__(self, session: Any, fail: Any) -> None:
        inputs = session.get_inputs()
        shown = ", ".join(f"{each.name} {each.type} {each.shape}" for each in inputs)
        accepted = f"its inputs are {shown}; accepted: one picture, 1x3xHxW or 1xHxWx3, of float, float16 or uint8"
        if len(inputs) != 1 or inputs[0].type not in TYPES or len(inputs[0].shape) != 4:
            raise fail(accepted)
        batch, *sides = inputs[0].shape
        self._name, self._type = inputs[0].name, TYPES[inputs[0].type]
        self._channels_first = sides[0] == 3
        if batch not in (1, None) and not isinstance(batch, str):
            raise fail(f"its batch is {batch}; accepted: 1")
        if 3 not in (sides[0], sides[2]):
            raise fail(accepted)
        self._sides = sides[1:] if self._channels_first else sides[:2]
        self.size = (USUAL_SIDE, USUAL_SIDE)
        """Width and height."""
        self.colors = "rgb"

    def settle_size(self, imgsz: str) -> None:
        """Set the input size from the file; ``imgsz``: [height, width] by its metadata, if any size is accepted."""
        named = _literal(imgsz)
        fallback = named if isinstance(named, list) and len(named) == 2 else [USUAL_SIDE, USUAL_SIDE]
        height, width = (
            side if isinstance(side, int) and side > 0 else int(usual)
            for side, usual in zip(self._sides, fallback, strict=True)
        )
        self.size = (width, height)

    def usual_colors(self, model_format: str) -> str:
        """Order and range of the colours that the format's models are trained with."""
        if model_format == "yolox":
            return "bgr255"
        return "rgb255" if self._type is np.uint8 else "rgb"

    def feed(self, fitted: Pixels) -> dict[str, NDArray[Any]]:
        """The input of one run."""
        colored = fitted if self.colors.startswith("bgr") else cv2.cvtColor(fitted, cv2.COLOR_BGR2RGB)
        values = colored if self._type is np.uint8 else colored.astype(np.float32)
        if not self.colors.endswith("255") and self._type is not np.uint8:
            values = values / np.float32(255.0)
        arranged = values.transpose(2, 0, 1) if self._channels_first else values
        return {self._name: np.ascontiguousarray(arranged[None], dtype=self._type)}


def _labels(names: str) -> tuple[str, ...]:
    """The labels in a file's metadata: a list, or a mapping by number, as Python writes it."""
    named = _literal(names)
    if isinstance(named, dict) and all(isinstance(number, int) for number in named):
        return tuple(str(named.get(number, number)) for number in range(max(named, default=-1) + 1))
    return tuple(map(str, named)) if isinstance(named, list | tuple) else ()


def _literal(text: str) -> object:
    """The value of a Python literal; None where the text is not one."""
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return None


def _first_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0][:160] if str(error).strip() else type(error).__name__
