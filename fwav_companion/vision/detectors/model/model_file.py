"""The file of a model: what is checked before onnxruntime opens it, and its errors as one line each."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fwav_companion.memory_limit import is_want_of_memory
from fwav_companion.on_disk import content as whole_content
from fwav_companion.vision.detectors.model.facts import ModelPort
from fwav_companion.vision.images import DetectorError

GRAPH, OPSETS = 7, 8
NODES, INITIALIZERS = 1, 5
OP_TYPE, ATTRIBUTES = 4, 5
ATTRIBUTE_TENSOR, ATTRIBUTE_GRAPH = 5, 6
EXTERNAL_DATA = 13
"""Field numbers of ModelProto, GraphProto, NodeProto, AttributeProto and TensorProto (onnx.proto)."""
DEEPEST_GRAPH: Final = 16
INT8_OPS: Final = ("QLinear", "QuantizeLinear", "DequantizeLinear", "ConvInteger", "MatMulInteger", "DynamicQuantize")

OUT_OF_MEMORY: Final = "it needs more memory than this process may use; a smaller model, or one without such constants"

Message = memoryview


@dataclass
class FileContent:
    """What the file names, as far as it concerns us."""

    locations: set[str] = field(default_factory=set)
    """Files beside it with its weights."""
    opset: int = 0
    """Version of ONNX's own operators."""
    is_int8: bool = False
    """Whether it computes with 8-bit integers."""


def file_content(data: bytes) -> FileContent:
    """The content of a model's file, as far as its bytes are a protocol buffer."""
    content = FileContent()
    try:
        for number, value in _fields(memoryview(data)):
            if number == GRAPH and isinstance(value, Message):
                _walk_graph(value, content, DEEPEST_GRAPH)
            elif number == OPSETS and isinstance(value, Message):
                opset = dict(_fields(value))
                if not bytes(opset.get(1, b"")).strip() and isinstance(opset.get(2), int):
                    content.opset = int(opset[2])
    except (IndexError, ValueError):
        pass  # not such a file: onnxruntime says so
    return content


def _walk_graph(graph: Message, content: FileContent, depth: int) -> None:
    if not depth:
        raise ValueError
    for number, value in _fields(graph):
        if number == INITIALIZERS and isinstance(value, Message):
            _walk_tensor(value, content)
        elif number == NODES and isinstance(value, Message):
            for name, part in _fields(value):
                if name == OP_TYPE and isinstance(part, Message):
                    content.is_int8 |= bytes(part).decode("utf-8", "replace").startswith(INT8_OPS)
                elif name == ATTRIBUTES and isinstance(part, Message):
                    _walk_attribute(part, content, depth)


def _walk_attribute(attribute: Message, content: FileContent, depth: int) -> None:
    for number, value in _fields(attribute):
        if number == ATTRIBUTE_TENSOR and isinstance(value, Message):
            _walk_tensor(value, content)
        elif number == ATTRIBUTE_GRAPH and isinstance(value, Message):
            _walk_graph(value, content, depth - 1)


def _walk_tensor(tensor: Message, content: FileContent) -> None:
    for number, value in _fields(tensor):
        if number == EXTERNAL_DATA and isinstance(value, Message):
            entry = {name: bytes(text) for name, text in _fields(value) if isinstance(text, Message)}
            if entry.get(1) == b"location":
                content.locations.add(entry.get(2, b"").decode("utf-8", "replace"))


def _fields(message: Message) -> Iterator[tuple[int, int | Message]]:
    """Field numbers and values of a protocol buffer: integers, and the bytes of all others."""
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        number, kind = key >> 3, key & 7
        if kind == 0:
            value, at = _varint(message, at)
            yield number, value
            continue
        if kind == 2:
            length, at = _varint(message, at)
        elif kind in (1, 5):
            length = 8 if kind == 1 else 4
        else:
            raise ValueError
        if at + length > len(message):
            raise ValueError
        yield number, message[at : at + length]
        at += length


def _varint(message: Message, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = message[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError


class ModelSession:
    """An open model."""

    def __init__(self, path: Path, threads: int) -> None:
        """DetectorError in one line where the file is not a model that runs here."""
        try:
            content = file_content(whole_content(path))
        except OSError as error:
            raise DetectorError(f"{error.strerror or error}") from None
        _require_beside(path, content.locations)
        self.is_int8 = content.is_int8
        self._session = _open_session(path, threads, content.opset)
        try:
            inputs = self._session.get_inputs()
            self.inputs = tuple(ModelPort(each.name, each.type, tuple(each.shape)) for each in inputs)
            self.metadata: dict[str, str] = dict(self._session.get_modelmeta().custom_metadata_map)
            self._outputs = [output.name for output in self._session.get_outputs()]
        except UnicodeDecodeError:
            raise DetectorError("it has names of tensors or metadata that are not UTF-8; export it again") from None

    def run(self, feed: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """The outputs by name. DetectorError where the model fails."""
        try:
            answers = self._session.run(self._outputs, feed)
        except Exception as error:  # noqa: BLE001  # onnxruntime has some ten classes without a common one
            if is_want_of_memory(error):
                raise DetectorError(OUT_OF_MEMORY) from None
            raise DetectorError(f"the model failed ({first_line(error)})") from None
        return {
            name: np.asarray(array, np.float32) if getattr(array, "dtype", None) == np.float16 else np.asarray(array)
            for name, array in zip(self._outputs, answers, strict=True)
        }


def _require_beside(path: Path, locations: set[str]) -> None:
    """Refuse weights that are missing, or outside the folder of the model: a file from elsewhere must not read them."""
    folder = path.parent.resolve()
    for location in sorted(locations):
        weights = (folder / location).resolve()
        if not weights.is_relative_to(folder):
            raise DetectorError(
                f"its weights are at {location!r}, outside its folder; accepted: a file next to the model"
            )
        if not weights.is_file():
            raise DetectorError(f"its weights {location!r} are missing; copy that file next to the model too")


def _open_session(path: Path, threads: int, opset: int) -> Any:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.log_severity_level = 4  # suppresses its own lines; our log reports a failure
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # noqa: BLE001  # as above
        text = str(error)
        newest = re.search(r"till opset (\d+)", text)
        version = re.search(r"model IR version: (\d+), max supported IR version: (\d+)", text)
        if newest is not None or version is not None:
            needed = f"opset {opset}" if newest is not None else f"format version {version[1]}"  # type: ignore[index]
            known = f"opset {newest[1]}" if newest is not None else f"version {version[2]}"  # type: ignore[index]
            raise DetectorError(
                f"it needs {needed}, onnxruntime {onnxruntime.__version__} knows {known} at most; update it, or "
                "export with an older opset (Ultralytics: opset=17)"
            ) from None
        if is_want_of_memory(error):
            raise DetectorError(OUT_OF_MEMORY) from None
        raise DetectorError(f"not a model that onnxruntime loads ({first_line(error)})") from None


def first_line(error: Exception) -> str:
    """The first line of an error of a library, shortened."""
    return str(error).strip().splitlines()[0][:160] if str(error).strip() else type(error).__name__
