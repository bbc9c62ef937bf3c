"""What a model's file and its first outputs state: the evidence by which its layout is recognized. PURE."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Outputs = Mapping[str, NDArray[np.generic]]
"""Outputs of one run by their names."""
STRIDES = (8, 16, 32)


@dataclass(frozen=True)
class ModelPort:
    """An input of a model."""

    name: str
    kind: str
    """onnxruntime's name of the type, as tensor(float)."""
    shape: tuple[int | str | None, ...]


@dataclass(frozen=True)
class ModelFacts:
    """What is known of a model before its outputs are read."""

    inputs: tuple[ModelPort, ...]
    metadata: Mapping[str, str]
    size: tuple[int, int]
    """Width and height of the input, pixels."""
    classes: int | None
    """Number of labels, background not counted; None where no labels are known."""

    @property
    def input_names(self) -> frozenset[str]:
        """Names of all inputs."""
        return frozenset(port.name for port in self.inputs)

    @property
    def is_ultralytics(self) -> bool:
        """Whether the metadata are those of Ultralytics' exporter."""
        return self.metadata.get("author", "") == "Ultralytics"

    @property
    def writes_stride_and_names(self) -> bool:
        """Whether the exporter is of the YOLOv5 line: it writes both, YOLOX's writes neither."""
        return {"stride", "names"} <= self.metadata.keys()

    @property
    def task(self) -> str:
        """detect, segment, pose, obb or another by the metadata; "" where they do not say."""
        return self.metadata.get("task", "")

    @property
    def keypoints(self) -> tuple[int, int] | None:
        """Number of keypoints and numbers of each, by the metadata."""
        shape = literal(self.metadata.get("kpt_shape", ""))
        if isinstance(shape, list | tuple) and len(shape) == 2 and all(isinstance(n, int) and n > 0 for n in shape):
            return shape[0], shape[1]
        return None

    @property
    def cells(self) -> int:
        """Number of cells of the three usual strides."""
        return sum((self.size[0] // stride) * (self.size[1] // stride) for stride in STRIDES)


def labels_of(names: str) -> tuple[str, ...]:
    """The labels in a file's metadata: a list, or a mapping by number, as Python writes it."""
    named = literal(names)
    if isinstance(named, dict) and all(isinstance(number, int) for number in named):
        return tuple(str(named.get(number, number)) for number in range(max(named, default=-1) + 1))
    return tuple(map(str, named)) if isinstance(named, list | tuple) else ()


def literal(text: str) -> object:
    """The value of a Python literal; None where the text is not one. Nothing is executed."""
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return None


def shown(outputs: Outputs) -> str:
    """The outputs for a message: name, type and shape of each."""
    return ", ".join(f"{name} {array.dtype} {'x'.join(map(str, array.shape))}" for name, array in outputs.items())
