"""Detects objects with the user's model file, by onnxruntime.

No model comes with this package. The file's layout, input and labels are found in its metadata, names, shapes and
first outputs, or set by the configuration; what these leave open is asked.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fwav_companion.vision.detectors.model.box_sigma import (
    INT8_FACTOR,
    PRIOR,
    centre_sigmas,
    cut_by,
    with_unknown_edges,
)
from fwav_companion.vision.detectors.model.boxes import Array, Boxes, suppressed
from fwav_companion.vision.detectors.model.decoders import Reading
from fwav_companion.vision.detectors.model.facts import ModelFacts, Outputs, labels_of, shown
from fwav_companion.vision.detectors.model.families import FAMILIES
from fwav_companion.vision.detectors.model.layouts import Layout
from fwav_companion.vision.detectors.model.letterbox import GREY, Letterbox, fit
from fwav_companion.vision.detectors.model.masks import mask_outline
from fwav_companion.vision.detectors.model.model_file import ModelSession
from fwav_companion.vision.detectors.model.model_input import ModelInput, preset_of
from fwav_companion.vision.detectors.model.plausibility import advice, implausible, sensible_formats
from fwav_companion.vision.detectors.model.recognition import Open, background_of, recognized
from fwav_companion.vision.detectors.model.tiles import PassBoxes, Tile, cut_edges, merged, tiles_of
from fwav_companion.vision.images import DetectorError, Found, Pixels
from fwav_companion.vision.task import VisionTask
from fwav_companion.vision.wire import MAX_DETECTIONS

_log = logging.getLogger(__name__)
MOST_CANDIDATES: Final = 2048
"""Most boxes above the least score that enter the suppression."""
MOST_UNDECIDED: Final = 50
"""Most pictures that are read in search of one that tells the layout."""
FIRST_PICTURES: Final = 50
"""Pictures whose outputs are judged."""
LONG_EMPTY: Final = 300
"""Pictures without any detection after which the log says so once: ten seconds at 30 pictures/s."""


class OnnxDetector:
    """Detector of the objects of one model."""

    def __init__(self, task: VisionTask) -> None:
        self._name = Path(task.model).name
        self._task = task
        self._pictures = 0
        self._complained = self._implausible_reported = False
        self._detected, self._best_score = 0, 0.0
        self.problem = ""
        """What is implausible in the first outputs; "" where nothing is."""
        try:
            self._open()
        except DetectorError as error:
            raise self._failure(str(error)) from None

    def _open(self) -> None:
        task = self._task
        self._session = ModelSession(Path(task.model), task.threads)
        metadata = self._session.metadata
        self._input = ModelInput(self._session.inputs)
        self._labels = task.model_labels or labels_of(metadata.get("names", ""))
        size = self._input.size(task.model_size, metadata.get("imgsz", ""))
        self._facts = ModelFacts(self._session.inputs, metadata, size, len(self._labels) or None)
        # The layout is not yet known: any preset shows names, types and shapes.
        grey = np.full((size[1], size[0], 3), GREY, np.uint8)
        preset = preset_of(task, FAMILIES["yolov8"])
        outputs = self._session.run(self._input.feed(grey, preset))
        self._layout: Layout | Open = recognized(task.model_format, self._facts, outputs)
        self._settle(outputs)

    def _settle(self, outputs: Outputs) -> None:
        """Derive from the layout what is read with it; for an open one, the preset of its first candidate."""
        layout = self._known_layout
        self._preset = preset_of(self._task, layout.family)
        if isinstance(self._layout, Layout):
            background = background_of(
                layout, self._task.model_background, facts=self._facts, outputs=outputs, labels=self._labels
            )
            self._reading = Reading(self._facts, background, layout.activation)
            self._decoded(outputs)

    @property
    def input_size(self) -> tuple[int, int]:
        """Width and height of the model's input, pixels."""
        return self._facts.size

    def described(self) -> str:
        """How the model is read, for `check` and the log."""
        layout, (width, height) = self._layout, self._facts.size
        if isinstance(layout, Open):
            return f"{width} x {height}; a picture with a detection will tell its layout; else {layout.message}"
        sigma = "as configured" if self._task.model_sigma != "auto" else "a prior, not measured: detect --sigma"
        levels = "levels as they are (normalized inside)" if self._input.takes_levels else self._preset.shown()
        background = {"none": "none", "first": "the first", "last": "the last"}[self._reading.background]
        return (
            f"{layout.name} (model_format = {layout.family.name}), {width} x {height}, {levels}"
            f"{', ' + self._preset.resize if self._input.takes_levels else ''}, background class: {background}, "
            f"sigma of boxes: {sigma}"
        )

    def detect(self, pixels: Pixels) -> list[Found]:
        """The objects, each at the centre of its box."""
        try:
            return self._found_in(pixels)
        except DetectorError as error:
            raise self._failure(str(error)) from None

    def _found_in(self, pixels: Pixels) -> list[Found]:
        height, width = pixels.shape[:2]
        self._pictures += 1
        passes = [self._pass(pixels, tile) for tile in tiles_of(width, height, *self._task.model_tiles)]
        several = len(passes) > 1
        seen = merged(_joined(passes), self._task.model_iou) if several else passes[0]
        seen = seen.where(np.arange(min(len(seen.boxes.scores), MAX_DETECTIONS)))
        self._detected += len(seen.boxes.scores)
        if self._pictures == LONG_EMPTY and not self._detected:
            _log.warning(
                "%s: no detection in %d pictures; the best score was %.2g, model_confidence is %g",
                self._name,
                LONG_EMPTY,
                self._best_score,
                self._task.model_confidence,
            )
        return self._written(seen, width, height)

    def _pass(self, pixels: Pixels, tile: Tile) -> PassBoxes:
        """The detections in one tile, in pixels of the picture."""
        part = pixels[tile.top : tile.bottom, tile.left : tile.right]
        fitted, letterbox = fit(part, self._facts.size, self._preset.resize)
        outputs = self._session.run(self._input.feed(fitted, self._preset))
        if isinstance(self._layout, Open):
            self._decide(self._layout, outputs)
            if isinstance(self._layout, Layout):  # with its own preset
                return self._pass(pixels, tile)
            return _joined([])
        boxes = self._decoded(outputs)
        if not self._implausible_reported and self._pictures <= FIRST_PICTURES:
            self._judge(boxes, outputs)
        boxes = self._best(boxes)
        if boxes.coefficients is not None:
            boxes = replace(boxes, outlines=_mask_outlines(boxes, outputs, self._facts.size))
        return self._boxes_in_picture(boxes, letterbox, tile, pixels)

    def _boxes_in_picture(self, boxes: Boxes, letterbox: Letterbox, tile: Tile, pixels: Pixels) -> PassBoxes:
        height, width = pixels.shape[:2]
        inner_width, inner_height = tile.right - tile.left, tile.bottom - tile.top
        edges = letterbox.picture_from_input(boxes.edges)
        edges = np.clip(edges, -0.5, [inner_width - 0.5, inner_height - 0.5] * 2)
        px_per_input = 1.0 / min(letterbox.scale)
        corner = np.array([tile.left, tile.top], np.float64)
        placed = replace(
            boxes,
            edges=edges + np.tile(corner, 2),
            outlines=None if boxes.outlines is None else letterbox.points_from_input(boxes.outlines) + corner,
            feet=None if boxes.feet is None else letterbox.points_from_input(boxes.feet) + corner,
            coefficients=None,
        )
        return PassBoxes(
            placed, np.full(len(edges), px_per_input), cut_edges(edges, tile, (width, height), px_per_input)
        )

    def _decide(self, layout: Open, outputs: dict[str, NDArray[Any]]) -> None:
        """Recognize the layout by the outputs of a picture. DetectorError after MOST_UNDECIDED pictures."""
        self._layout = recognized(self._task.model_format, self._facts, outputs)
        if isinstance(self._layout, Layout):
            self._settle(outputs)
        elif self._pictures >= MOST_UNDECIDED:
            raise DetectorError(f"after {self._pictures} pictures without a detection {layout.message}")

    @property
    def _known_layout(self) -> Layout:
        return self._layout if isinstance(self._layout, Layout) else self._layout.candidates[0]

    def _decoded(self, outputs: Outputs) -> Boxes:
        layout = self._known_layout
        try:
            return layout.decode(outputs, self._reading)
        except (ValueError, IndexError, KeyError, StopIteration):
            raise DetectorError(
                f'its outputs ({shown(outputs)}) do not fit [vision] model_format = "{layout.family.name}"'
            ) from None

    def _judge(self, boxes: Boxes, outputs: Outputs) -> None:
        """Report once what is implausible in the first outputs."""
        problem = implausible(boxes, self._facts.size, self._task.model_confidence)
        if problem:
            layout = self._known_layout
            self._implausible_reported = True
            formats = sensible_formats(outputs, self._reading, layout, self._task.model_confidence)
            self.problem = advice(problem, formats, layout, self._preset.shown())
            _log.warning("%s: %s", self._name, self.problem)

    def _best(self, boxes: Boxes) -> Boxes:
        """The boxes that count: finite, sure enough, of a class, without those that overlap."""
        finite = np.isfinite(boxes.edges).all(axis=1) & np.isfinite(boxes.scores)
        if not finite.all() and not self._complained:
            self._complained = True
            number = int((~finite).sum())
            _log.warning(
                "%s: %d outputs are not finite numbers: dropped, further ones without a message", self._name, number
            )
        self._best_score = max(self._best_score, float(boxes.scores[finite].max(initial=0.0)))
        boxes = boxes.where(finite & (boxes.scores >= self._task.model_confidence) & (boxes.classes >= 0))
        boxes = boxes.where(np.argsort(-boxes.scores, kind="stable")[:MOST_CANDIDATES])
        if self._known_layout.overlaps:
            return suppressed(boxes, self._task.model_iou, MAX_DETECTIONS)
        return boxes.where(np.arange(min(len(boxes.scores), MAX_DETECTIONS)))

    def _written(self, seen: PassBoxes, width: int, height: int) -> list[Found]:
        boxes = seen.boxes
        model = PRIOR if self._task.model_sigma == "auto" else self._task.model_sigma
        sigmas = centre_sigmas(boxes.edges, boxes.scores, seen.px_per_input, model)
        if self._session.is_int8 and self._task.model_sigma == "auto":
            sigmas = INT8_FACTOR * sigmas
        sigmas = with_unknown_edges(sigmas, boxes.edges, seen.cut | cut_by(boxes.edges, width, height))
        return [self._found(boxes, sigmas, i) for i in range(len(boxes.scores))]

    def _found(self, boxes: Boxes, sigmas: Array, i: int) -> Found:
        left, top, right, bottom = boxes.edges[i].tolist()
        number = int(boxes.classes[i])
        middle = boxes.edges[i].reshape(2, 2).mean(axis=0)
        across, along = self._task.model_bias
        found: Found = {
            "u": round(float(middle[0]) - across * (right - left), 3),
            "v": round(float(middle[1]) - along * (bottom - top), 3),
            "sigma": [round(float(sigma), 3) for sigma in sigmas[i]],
            "label": self._labels[number] if number < len(self._labels) else str(number),
            "score": round(min(1.0, float(boxes.scores[i])), 4),
            "box": [round(edge, 2) for edge in (left, top, right, bottom)],
        }
        if boxes.outlines is not None and np.isfinite(boxes.outlines[i]).all():
            found["outline"] = np.round(boxes.outlines[i], 2).tolist()
        if boxes.feet is not None and np.isfinite(boxes.feet[i]).all():
            found["foot"] = np.round(boxes.feet[i], 3).tolist()
        return found

    def _failure(self, what: str) -> DetectorError:
        return DetectorError(what if what.startswith("[vision]") else f"[vision] model {self._name}: {what}")


def _joined(passes: list[PassBoxes]) -> PassBoxes:
    """The detections of several passes together."""
    if not passes:
        none = np.zeros(0)
        return PassBoxes(Boxes(none.reshape(0, 4), none, none.astype(np.int64)), none, np.zeros((0, 4), np.bool_))
    columns = ("edges", "scores", "classes", "outlines", "feet")
    stacked = {}
    for name in columns:
        arrays = [array for each in passes if (array := getattr(each.boxes, name)) is not None]
        stacked[name] = np.concatenate(arrays) if len(arrays) == len(passes) else None
    return PassBoxes(
        Boxes(**stacked),  # type: ignore[arg-type]
        np.concatenate([each.px_per_input for each in passes]),
        np.concatenate([each.cut for each in passes]),
    )


def _mask_outlines(boxes: Boxes, outputs: Outputs, size: tuple[int, int]) -> Array | None:
    prototypes = next((array for array in outputs.values() if array.ndim == 4), None)
    if prototypes is None or boxes.coefficients is None:
        return None
    outlines = [
        mask_outline(*each, np.asarray(prototypes[0]), size)
        for each in zip(boxes.coefficients, boxes.edges, strict=True)
    ]
    return np.array(outlines, np.float64).reshape(len(boxes.scores), -1, 2)
