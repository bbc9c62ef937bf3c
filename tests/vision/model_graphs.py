"""Small ONNX graphs with known answers."""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper


def saved(path, graph, metadata=None):
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    for key, value in (metadata or {}).items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return str(path)


def picture_input(shape=(1, 3, 64, 64), kind=TensorProto.FLOAT, name="images"):
    return helper.make_tensor_value_info(name, kind, shape)


def constant_model(path, outputs, *, metadata=None, inputs=None):
    """A model that answers these arrays, whatever it sees."""
    nodes = [helper.make_node("Constant", [], [name], value=numpy_helper.from_array(a)) for name, a in outputs.items()]
    infos = [
        helper.make_tensor_value_info(name, helper.np_dtype_to_tensor_dtype(a.dtype), a.shape)
        for name, a in outputs.items()
    ]
    graph = helper.make_graph(nodes, "constant", inputs or [picture_input()], infos)
    return saved(path, graph, metadata)


def brightest_pixel_model(path, *, channel, score_of_level=True):
    """YOLOv8's layout: one box of 4 x 4 at the brightest pixel of a channel, its score the level there."""
    arrays = {
        "channel": np.array([channel], np.int64),
        "flat": np.array([1, -1], np.int64),
        "width": np.array(64, np.int64),
        "half": np.array([[0.5]], np.float32),
        "sides": np.array([[4.0], [4.0]], np.float32).reshape(1, 2, 1),
        "others": np.zeros((1, 5, 7), np.float32),
        "axes": np.array([2], np.int64),
        "one_axis": np.array([1], np.int64),
    }
    nodes = [
        helper.make_node("Gather", ["images", "channel"], ["plane"], axis=1),
        helper.make_node("Reshape", ["plane", "flat"], ["row"]),
        helper.make_node("ArgMax", ["row"], ["place"], axis=1, keepdims=1),
        helper.make_node("ReduceMax", ["row"], ["level"], axes=[1], keepdims=1),
        helper.make_node("Mod", ["place", "width"], ["u"]),
        helper.make_node("Div", ["place", "width"], ["v"]),
        helper.make_node("Cast", ["u"], ["uf"], to=TensorProto.FLOAT),
        helper.make_node("Cast", ["v"], ["vf"], to=TensorProto.FLOAT),
        helper.make_node("Add", ["uf", "half"], ["cx"]),
        helper.make_node("Add", ["vf", "half"], ["cy"]),
        helper.make_node("Unsqueeze", ["cx", "axes"], ["cx3"]),
        helper.make_node("Unsqueeze", ["cy", "axes"], ["cy3"]),
        helper.make_node("Unsqueeze", ["level", "axes"], ["level3"]),
        helper.make_node("Concat", ["cx3", "cy3", "sides", "level3"], ["box"], axis=1),
        helper.make_node("Concat", ["box", "others"], ["output0"], axis=2),
    ]
    initializers = [numpy_helper.from_array(a, name) for name, a in arrays.items()]
    graph = helper.make_graph(
        nodes,
        "brightest",
        [picture_input()],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, (1, 5, 8))],
        initializers,
    )
    return saved(path, graph, {"names": "{0: 'light'}"})


def light_row_model(path, row, *, rows, names="['person', 'car']"):
    """End to end rows: the row comes only with a picture whose mean level exceeds 0.5; others are zero."""
    answer = np.zeros((1, rows, len(row)), np.float32)
    answer[0, 2] = row
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=0),
        helper.make_node("Greater", ["mean", "half"], ["lit"]),
        helper.make_node("Cast", ["lit"], ["factor"], to=TensorProto.FLOAT),
        helper.make_node("Mul", ["answer", "factor"], ["output0"]),
    ]
    initializers = [
        numpy_helper.from_array(np.array(0.5, np.float32), "half"),
        numpy_helper.from_array(answer, "answer"),
    ]
    info = helper.make_tensor_value_info("output0", TensorProto.FLOAT, answer.shape)
    graph = helper.make_graph(nodes, "light", [picture_input()], [info], initializers)
    return saved(path, graph, {"names": names})


def echo_model(path):
    """YOLOv8's layout of three classes: the first three rows of the first column are the first pixel's channels."""
    nodes = [
        helper.make_node("Slice", ["images", "starts", "ends", "axes"], ["pixel"]),
        helper.make_node("Reshape", ["pixel", "shape"], ["three"]),
        helper.make_node("Concat", ["three", "rest"], ["column"], axis=1),
        helper.make_node("Concat", ["column", "others"], ["output0"], axis=2),
    ]
    arrays = {
        "starts": np.array([0, 0], np.int64),
        "ends": np.array([1, 1], np.int64),
        "axes": np.array([2, 3], np.int64),
        "shape": np.array([1, 3, 1], np.int64),
        "rest": np.zeros((1, 4, 1), np.float32),
        "others": np.zeros((1, 7, 9), np.float32),
    }
    initializers = [numpy_helper.from_array(array, name) for name, array in arrays.items()]
    info = helper.make_tensor_value_info("output0", TensorProto.FLOAT, (1, 7, 10))
    graph = helper.make_graph(nodes, "echo", [picture_input()], [info], initializers)
    return saved(path, graph, {"names": "['a', 'b', 'c']"})
