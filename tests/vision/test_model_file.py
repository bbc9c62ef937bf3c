"""Files of models that do not run here are one line each; what they hold beside their weights is read."""

import os

import numpy as np
import onnx
import pytest
from model_graphs import constant_model, picture_input
from model_layouts import LAYOUTS, NAMES, WIDE
from onnx import TensorProto, helper, numpy_helper
from onnx.external_data_helper import convert_model_to_external_data

from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.detectors.model.model_file import ModelSession, file_content
from fwav_companion.vision.images import DetectorError
from fwav_companion.vision.task import VisionTask


def detector(path, **settings):
    return make_detector(VisionTask("x", detector="onnx", model=str(path), **settings))


def weighted_model(path, location):
    """YOLOv8's layout with its answer in a file beside the model."""
    answer = numpy_helper.from_array(LAYOUTS["yolov8"][0]["output0"], "answer")
    node = helper.make_node("Identity", ["answer"], ["output0"])
    info = helper.make_tensor_value_info("output0", TensorProto.FLOAT, (1, 7, 84))
    graph = helper.make_graph([node], "weighted", [picture_input()], [info], [answer])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    model.metadata_props.add(key="names", value=NAMES["names"])
    convert_model_to_external_data(model, location="weights.bin", size_threshold=0, convert_attribute=True)
    onnx.save(model, str(path))
    data = path.read_bytes()
    assert file_content(data).locations == {"weights.bin"}
    if location != "weights.bin":
        for entry in model.graph.initializer[0].external_data:
            if entry.key == "location":
                entry.value = location
        path.write_bytes(model.SerializeToString())
    return path


def test_weights_beside_the_model_are_read(tmp_path):
    (found,) = detector(weighted_model(tmp_path / "m.onnx", "weights.bin")).detect(WIDE)
    assert found["label"] == "car"


def test_missing_weights_are_named(tmp_path):
    path = weighted_model(tmp_path / "m.onnx", "weights.bin")
    (tmp_path / "weights.bin").unlink()
    with pytest.raises(
        DetectorError, match=r"its weights 'weights\.bin' are missing; copy that file next to the model"
    ):
        detector(path)


@pytest.mark.parametrize("location", ["../outside.bin", "/etc/passwd", "a/../../outside.bin", "link.bin"])
def test_weights_outside_the_folder_are_refused(tmp_path, location):
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "outside.bin").write_bytes(bytes(7 * 84 * 4))
    (folder / "link.bin").symlink_to(tmp_path / "outside.bin")
    path = weighted_model(folder / "m.onnx", location)
    with pytest.raises(
        DetectorError, match=rf"its weights are at {location!r}, outside its folder; accepted: a file next"
    ):
        detector(path)


@pytest.mark.parametrize(("opset", "ir_version"), [(99, 8), (17, 99)])
def test_a_model_for_a_newer_runtime_says_what_it_needs(tmp_path, opset, ir_version):
    node = helper.make_node("Identity", ["images"], ["output0"])
    info = helper.make_tensor_value_info("output0", TensorProto.FLOAT, (1, 3, 64, 64))
    graph = helper.make_graph([node], "new", [picture_input()], [info])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)])
    model.ir_version = ir_version
    (tmp_path / "m.onnx").write_bytes(model.SerializeToString())
    with pytest.raises(
        DetectorError, match=r"^\[vision\] model m\.onnx: it needs .* 99, onnxruntime .* knows [^\n]*older opset[^\n]*$"
    ):
        detector(tmp_path / "m.onnx")


def test_boxes_of_an_int8_model_are_less_certain(tmp_path):
    """The answer passes through quantization to whole numbers: the model computes with 8 bits."""
    outputs = LAYOUTS["yolov8"][0]
    sigma = detector(constant_model(tmp_path / "f.onnx", outputs, metadata=NAMES)).detect(WIDE)[0]["sigma"]
    answer = numpy_helper.from_array(outputs["output0"], "answer")
    scale = numpy_helper.from_array(np.array(1 / 128, np.float32), "scale")
    zero = numpy_helper.from_array(np.array(0, np.uint8), "zero")
    some = numpy_helper.from_array(np.zeros(1, np.float32), "some")
    nodes = [
        helper.make_node("QuantizeLinear", ["some", "scale", "zero"], ["whole"]),
        helper.make_node("DequantizeLinear", ["whole", "scale", "zero"], ["nothing"]),
        helper.make_node("Add", ["answer", "nothing"], ["output0"]),
    ]
    info = helper.make_tensor_value_info("output0", TensorProto.FLOAT, (1, 7, 84))
    graph = helper.make_graph(nodes, "int8", [picture_input()], [info], [answer, scale, zero, some])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    model.metadata_props.add(key="names", value=NAMES["names"])
    onnx.save(model, str(tmp_path / "q.onnx"))
    assert detector(tmp_path / "q.onnx").detect(WIDE)[0]["sigma"] == pytest.approx([1.5 * s for s in sigma], abs=2e-3)


def test_a_pipe_as_a_model_is_one_line(tmp_path):
    """It was waited for, without a word."""
    os.mkfifo(tmp_path / "m.onnx")
    with pytest.raises(DetectorError, match="Is a pipe"):
        ModelSession(tmp_path / "m.onnx", 1)


def test_any_bytes_have_a_content():
    rng = np.random.default_rng(1)
    whole = LAYOUTS["yolov8"][0]["output0"].tobytes()
    for size in (0, 1, 10, 1000):
        for _ in range(50):
            file_content(rng.integers(0, 256, size, dtype=np.uint8).tobytes() + whole[:size])
