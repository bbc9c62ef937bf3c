"""The detector of model files, on small graphs whose answers are known."""

import numpy as np
import pytest
from model_graphs import brightest_pixel_model, constant_model, picture_input
from model_layouts import LAYOUTS, NAMES, WIDE, in_input, rows_with
from onnx import TensorProto

from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.images import DetectorError
from fwav_companion.vision.task import VisionTask


def detector(path, **settings):
    return make_detector(VisionTask("x", detector="onnx", model=str(path), **settings))


@pytest.mark.parametrize(
    ("colors", "channel", "level", "score"),
    [("rgb", 0, 200, 200 / 255), ("bgr", 2, 200, 200 / 255), ("rgb255", 0, 1, 1.0), ("auto", 0, 200, 200 / 255)],
)
def test_the_colours_and_the_place_of_a_pixel_reach_the_model(tmp_path, colors, channel, level, score):
    """Two by two red pixels of the picture are one of the input; the box lies exactly on them."""
    path = brightest_pixel_model(tmp_path / "m.onnx", channel=channel)
    picture = np.zeros((96, 128, 3), np.uint8)
    picture[20:22, 40:42] = (0, 0, level)
    model = detector(path, model_input=colors)
    if colors != "rgb255":
        (found,) = model.detect(picture)
    else:  # the margins have 114 of 255, more than the light
        full = np.zeros((128, 128, 3), np.uint8)
        full[20:22, 40:42] = (0, 0, level)
        (found,) = model.detect(full)
    assert (found["u"], found["v"]) == pytest.approx((40.5, 20.5), abs=1e-6)
    assert (found["label"], found["score"]) == ("light", pytest.approx(score, abs=1e-3))


def test_overlapping_boxes_of_one_label_are_one_and_the_best_256_are_kept(tmp_path):
    rng = np.random.default_rng(1)
    rows = np.zeros((1, 1200, 7), np.float32)
    rows[0, :, :2] = rng.uniform(10.0, 630.0, (1200, 2))
    rows[0, :, 2:4] = 4.0
    rows[0, :, 4 + 1] = rng.uniform(0.3, 0.9, 1200)
    rows[0, 0, :] = [100.0, 100.0, 50.0, 40.0, 0.0, 0.99, 0.0]
    rows[0, 1, :] = [102.0, 101.0, 50.0, 40.0, 0.0, 0.95, 0.0]  # the same car
    rows[0, 2, :] = [102.0, 101.0, 50.0, 40.0, 0.98, 0.0, 0.0]  # a person in it
    path = constant_model(
        tmp_path / "m.onnx",
        {"o": rows.transpose(0, 2, 1).copy()},
        metadata=NAMES,
        inputs=[picture_input((1, 3, 640, 640))],
    )
    found = detector(path).detect(np.zeros((640, 640, 3), np.uint8))
    assert len(found) == 256
    assert [each["score"] for each in found] == sorted((each["score"] for each in found), reverse=True)
    assert [(each["label"], each["u"]) for each in found[:2]] == [("car", 99.5), ("person", 101.5)]
    assert not [each for each in found if each["label"] == "car" and (each["u"], each["v"]) == (101.5, 100.5)]
    assert found[0]["sigma"] == pytest.approx([np.hypot(0.5, 0.03 * 50.0), np.hypot(0.5, 0.03 * 40.0)], abs=1e-3)


def test_outputs_that_are_no_numbers_are_dropped_with_one_line(tmp_path, caplog):
    rows = rows_with([*in_input("letterbox"), 0.9, 1.0], 300)
    rows[0, 5] = np.nan
    rows[0, 6] = [np.inf, 0.0, 1.0, 1.0, 0.8, 1.0]
    path = constant_model(tmp_path / "m.onnx", {"o": rows}, metadata=NAMES)
    model = detector(path)
    for _ in range(3):
        assert len(model.detect(WIDE)) == 1
    assert [record.getMessage() for record in caplog.records] == [
        "m.onnx: 2 outputs are not finite numbers: dropped, further ones without a message"
    ]


def test_no_detection_for_ever_is_one_line_with_the_best_score(tmp_path, caplog):
    path = constant_model(
        tmp_path / "m.onnx", {"o": rows_with([*in_input("letterbox"), 0.11, 1.0], 300)}, metadata=NAMES
    )
    model = detector(path)
    for _ in range(620):
        assert model.detect(WIDE) == []
    assert [record.getMessage() for record in caplog.records] == [
        "m.onnx: no detection in 300 pictures; the best score was 0.11, model_confidence is 0.25"
    ]


def test_labels_by_the_configuration_where_the_file_has_none(tmp_path):
    path = constant_model(tmp_path / "m.onnx", LAYOUTS["nms7"][0])
    assert detector(path).detect(WIDE)[0]["label"] == "1"
    assert detector(path, model_labels=("a", "b")).detect(WIDE)[0]["label"] == "b"
    named = constant_model(tmp_path / "n.onnx", LAYOUTS["nms7"][0], metadata={"names": "__import__('os').getcwd()"})
    assert detector(named).detect(WIDE)[0]["label"] == "1", "metadata is data, never code"


@pytest.mark.parametrize(
    ("inputs", "reported"),
    [
        ([picture_input((1, 4, 64, 64))], "accepted: one picture, 1x3xHxW, 1xHxWx3"),
        ([picture_input((4, 3, 64, 64))], "its batch is 4; accepted: 1"),
        ([picture_input(), picture_input(name="sizes")], "images tensor.* sizes tensor.*accepted: one picture"),
        ([picture_input(kind=TensorProto.INT64)], r"tensor\(int64\).*accepted: one picture"),
    ],
)
def test_other_inputs_are_refused_in_one_line(tmp_path, inputs, reported):
    path = constant_model(tmp_path / "m.onnx", LAYOUTS["nms7"][0], inputs=inputs)
    with pytest.raises(DetectorError, match=rf"^\[vision\] model m\.onnx: [^\n]*{reported}[^\n]*$"):
        detector(path)


def test_a_size_of_any_number_is_that_of_the_metadata(tmp_path):
    path = constant_model(
        tmp_path / "m.onnx",
        LAYOUTS["nms7"][0],
        inputs=[picture_input((1, 3, "height", "width"))],
        metadata={**NAMES, "imgsz": "[64, 64]"},
    )
    assert detector(path).detect(WIDE)[0]["u"] == pytest.approx(35.5, abs=0.01)


@pytest.mark.parametrize("content", [b"", b"not a model", b"\x08\x07" * 50])
def test_what_is_no_model_is_one_clear_line(tmp_path, content):
    (tmp_path / "m.onnx").write_bytes(content)
    with pytest.raises(
        DetectorError, match=r"^\[vision\] model m\.onnx: not a model that onnxruntime loads \([^\n]*\)$"
    ):
        detector(tmp_path / "m.onnx")


def test_outputs_of_another_format_than_the_configured_are_refused(tmp_path):
    path = constant_model(tmp_path / "m.onnx", LAYOUTS["yolov8"][0])
    with pytest.raises(DetectorError, match=r'1x7x84\) do not fit \[vision\] model_format = "nms7"'):
        detector(path, model_format="nms7")
