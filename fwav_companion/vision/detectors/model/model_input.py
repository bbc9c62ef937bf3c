"""The inputs of a model: its picture, and the second inputs that some families have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fwav_companion.vision.detectors.model.facts import ModelPort, literal
from fwav_companion.vision.detectors.model.families import MEANS_AND_DEVIATIONS, Family, MeanAndDeviation
from fwav_companion.vision.detectors.model.letterbox import Resize
from fwav_companion.vision.images import DetectorError, Pixels
from fwav_companion.vision.task import VisionTask

TYPES: Final = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(uint8)": np.uint8,
    "tensor(int8)": np.int8,
    "tensor(int32)": np.int32,
    "tensor(int64)": np.int64,
    "tensor(bool)": np.bool_,
}
PICTURE_TYPES: Final = ("tensor(float)", "tensor(float16)", "tensor(uint8)")
ACCEPTED: Final = (
    "accepted: one picture, 1x3xHxW, 1xHxWx3 or 3xHxW, of float, float16 or uint8, and orig_target_sizes, "
    "scale_factor, im_shape or pixel_mask"
)


@dataclass(frozen=True)
class Preset:
    """How a picture becomes an input: the family's preset with what the configuration overrides."""

    colors: str
    mean_and_deviation: MeanAndDeviation
    """In the order of ``colors``, of levels 0 to 255."""
    resize: Resize

    def shown(self) -> str:
        """The preset for `check` and the log."""
        names = {value: name for name, value in MEANS_AND_DEVIATIONS.items()}
        mean, deviation = self.mean_and_deviation
        named = names.get(self.mean_and_deviation) if self.colors == "rgb" or mean[0] == mean[2] else None
        scaled = {"none": "0 to 255", "255": "0 to 1", "imagenet": "less ImageNet's mean, over its deviation"}
        return (
            f"{self.colors}, {scaled[named] if named else f'less {list(mean)} over {list(deviation)}'}, {self.resize}"
        )


def preset_of(task: VisionTask, family: Family) -> Preset:
    """The preset of a family with the task's overrides."""
    colors, normalize = family.colors, family.normalize
    if task.model_input != "auto":
        colors = "bgr" if task.model_input.startswith("bgr") else "rgb"
        normalize = "none" if task.model_input.endswith("255") else "255"
    if task.model_normalize != "auto":
        normalize = task.model_normalize
    if isinstance(normalize, str):
        mean, deviation = MEANS_AND_DEVIATIONS[normalize]
        pair = (mean, deviation) if colors == "rgb" else (mean[::-1], deviation[::-1])
    else:
        pair = normalize
    return Preset(colors, pair, family.resize if task.model_resize == "auto" else task.model_resize)


class ModelInput:
    """The inputs of one model, the picture first among those of rank 3 or 4."""

    def __init__(self, ports: tuple[ModelPort, ...]) -> None:
        """DetectorError for inputs that are not served."""
        shown = ", ".join(f"{port.name} {port.kind} {list(port.shape)}" for port in ports)
        pictures = [
            port for port in ports if len(port.shape) in (3, 4) and port.kind in PICTURE_TYPES and 3 in _sides(port)
        ]
        self._others = [port for port in ports if port not in pictures]
        known = ("orig_target_sizes", "scale_factor", "im_shape", "pixel_mask")
        if len(pictures) != 1 or any(port.name not in known or port.kind not in TYPES for port in self._others):
            raise DetectorError(f"its inputs are {shown}; {ACCEPTED}")
        self._picture = pictures[0]
        self._type = TYPES[self._picture.kind]
        batch, sides = self._picture.shape[0], _sides(self._picture)
        self.has_batch = len(self._picture.shape) == 4
        if self.has_batch and batch not in (1, None) and not isinstance(batch, str):
            raise DetectorError(f"its batch is {batch}; accepted: 1, or an export with a dynamic batch")
        self._channels_first = sides[0] == 3
        self._height_width = sides[1:] if self._channels_first else sides[:2]

    @property
    def takes_levels(self) -> bool:
        """Whether the picture is of whole levels: its normalization is inside the graph."""
        return self._type is np.uint8

    def size(self, wanted: str | tuple[int, int], imgsz: str) -> tuple[int, int]:
        """Width and height of the picture: fixed in the file, else model_size, else the metadata. DetectorError
        without any of them.
        """
        fixed = [side if isinstance(side, int) and side > 0 else None for side in self._height_width]
        named = literal(imgsz)
        if isinstance(named, int):
            named = [named, named]
        if not isinstance(wanted, str):
            asked: list[int] | None = [wanted[1], wanted[0]]
        elif isinstance(named, list | tuple) and len(named) == 2 and all(isinstance(n, int) and n > 0 for n in named):
            asked = list(named)
        else:
            asked = None
        if asked is None and None in fixed:
            raise DetectorError("its size is left open; set [vision] model_size = [width, height], as [640, 640]")
        height, width = (side or other for side, other in zip(fixed, asked or (0, 0), strict=True))
        if not isinstance(wanted, str) and (width, height) != tuple(wanted):
            raise DetectorError(f"its size is {width} x {height}; accepted: model_size = [{width}, {height}] or auto")
        return int(width), int(height)

    def feed(self, fitted: Pixels, preset: Preset) -> dict[str, NDArray[Any]]:
        """The inputs of one run, for a picture of the input's size."""
        colored = fitted if preset.colors == "bgr" else cv2.cvtColor(fitted, cv2.COLOR_BGR2RGB)
        values: NDArray[Any] = colored
        if not self.takes_levels:
            mean, deviation = (np.array(each, np.float32) for each in preset.mean_and_deviation)
            values = colored.astype(np.float32)
            if mean.any():
                values -= mean
            if (deviation != 1.0).any():
                values /= deviation
        arranged = values.transpose(2, 0, 1) if self._channels_first else values
        batched = arranged[None] if self.has_batch else arranged
        height, width = fitted.shape[:2]
        feed: dict[str, NDArray[Any]] = {self._picture.name: np.ascontiguousarray(batched, dtype=self._type)}
        for port in self._others:
            # Boxes then come in pixels of the input: the letterbox alone maps them to the picture.
            value: Any = {
                "orig_target_sizes": [[width, height]],
                "scale_factor": [[1.0, 1.0]],
                "im_shape": [[height, width]],
            }.get(port.name)
            if port.name == "pixel_mask":
                sides = [n if isinstance(n, int) else m for n, m in zip(port.shape[1:], (height, width), strict=False)]
                value = np.ones((1, *sides))
            feed[port.name] = np.asarray(value, TYPES[port.kind])
        return feed


def _sides(port: ModelPort) -> tuple[int | str | None, ...]:
    return port.shape[-3:]
