"""What the first outputs of a wrongly read model show is reported once, with the format that makes sense of it."""

import logging

import numpy as np
import pytest
from model_graphs import constant_model, picture_input
from model_layouts import BOX, NAMES, WIDE, columns_with, in_input, rows_with

from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.task import VisionTask

rng = np.random.default_rng(3)


def detector(path, **settings):
    return make_detector(VisionTask("x", detector="onnx", model=str(path), **settings))


def problem(model, caplog):
    """The problem after three pictures, of which the log has one line."""
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            model.detect(WIDE)
    lines = [record.getMessage() for record in caplog.records]
    assert lines == ([f"m.onnx: {model.problem}"] if model.problem else [])
    return model.problem


def test_scores_above_one_are_reported(tmp_path, caplog):
    path = constant_model(tmp_path / "m.onnx", {"o": columns_with([20, 20, 8, 8, 0.1, 14.0, 0.1])}, metadata=NAMES)
    assert problem(detector(path), caplog).startswith(
        "scores up to 14; a score is at most 1, read as yolov8 (rgb, 0 to 1"
    )


def test_class_and_score_exchanged_name_the_format_that_makes_sense(tmp_path, caplog):
    """The flat rows of YOLO-NAS read as YOLOv7's: the class becomes the score."""
    rows = np.array([[0, *BOX, 0.9, 2], [0, *BOX, 0.8, 1]], np.float32)
    path = constant_model(tmp_path / "m.onnx", {"o": rows}, metadata=NAMES)
    text = problem(detector(path, model_format="nms7"), caplog)
    assert text.startswith("scores up to 2;")
    assert text.endswith("model_format = yolonas would make sense of it")


def test_pixels_read_as_shares_end_beyond_the_picture(tmp_path, caplog):
    """End to end rows of two classes read as RT-DETR's."""
    rows = np.zeros((1, 300, 6), np.float32)
    rows[0, :20, :2] = rng.uniform(5, 30, (20, 2))
    rows[0, :20, 2:4] = rows[0, :20, :2] + 10.0
    rows[0, :20, 4] = 0.9
    rows[0, :20, 5] = 1.0
    path = constant_model(tmp_path / "m.onnx", {"o": rows}, metadata={"names": "['a', 'b']"})
    text = problem(detector(path, model_format="rtdetr"), caplog)
    assert "boxes end far beyond the picture" in text
    assert "model_format = yolov10 would make sense of it" in text


def test_shares_read_as_pixels_lie_in_one_corner(tmp_path, caplog):
    rows = np.zeros((1, 300, 7), np.float32)
    rows[0, :20, :2] = rng.uniform(0.2, 0.7, (20, 2))
    rows[0, :20, 2:4] = rows[0, :20, :2] + 0.1
    rows[0, :20, 4], rows[0, :20, 5] = 0.9, 1.0
    path = constant_model(tmp_path / "m.onnx", {"o": rows[:, :, :6].copy()}, metadata=NAMES)
    assert "all 20 boxes lie in one corner of the picture" in problem(detector(path), caplog)


@pytest.mark.parametrize("count", [1, 20])
def test_sound_outputs_are_not_reported(tmp_path, caplog, count):
    rows = np.zeros((1, 300, 6), np.float32)
    rows[0, :count, :2] = rng.uniform(2, 50, (count, 2))
    rows[0, :count, 2:4] = rows[0, :count, :2] + 10.0
    rows[0, :count, 4], rows[0, :count, 5] = 0.9, 1.0
    assert problem(detector(constant_model(tmp_path / "m.onnx", {"o": rows}, metadata=NAMES)), caplog) == ""


def test_reading_is_described_with_the_preset(tmp_path):
    path = constant_model(tmp_path / "m.onnx", {"o": rows_with([*BOX, 0.9, 1.0], 300)}, metadata=NAMES)
    assert detector(path).described() == (
        "YOLOv10, 26, end to end (model_format = yolov10), 64 x 64, rgb, 0 to 1, letterbox, background class: none, "
        "sigma of boxes: a prior, not measured: detect --sigma"
    )
    boxes = in_input("stretch")[None].astype(np.float32)
    outputs = {"boxes": boxes, "labels": np.array([2]), "scores": np.array([0.9], np.float32)}
    path = constant_model(tmp_path / "m.onnx", outputs, metadata=NAMES, inputs=[picture_input((3, 64, 64))])
    assert "torchvision), 64 x 64, rgb, 0 to 1, stretch, background class: the first" in detector(path).described()
