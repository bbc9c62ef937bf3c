"""Every layout of the handbook's table is read right without settings, asked for, or refused by its name."""

import re

import numpy as np
import pytest
from model_graphs import constant_model, picture_input
from model_layouts import (
    ASKED,
    BOX,
    CLASSES,
    LAYOUTS,
    NAMES,
    REFUSED,
    TRUE,
    ULTRALYTICS,
    WIDE,
    centred,
    columns_with,
    in_input,
    rows_with,
    written,
)
from onnx import TensorProto

from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.images import DetectorError
from fwav_companion.vision.task import VisionTask


def detector(path, **settings):
    return make_detector(VisionTask("x", detector="onnx", model=str(path), **settings))


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("picture", [WIDE, WIDE[:, :, 0]], ids=["colour", "grey"])
def test_layout_is_recognized_and_gives_the_box_in_the_pictures_pixels(tmp_path, name, picture):
    *_, label, settings = LAYOUTS[name]
    (found,) = detector(written(tmp_path / "m.onnx", name), **settings).detect(picture)
    assert found["box"] == pytest.approx([edge - 0.5 for edge in TRUE], abs=0.01)
    assert (found["u"], found["v"]) == pytest.approx((35.5, 22.0), abs=0.01)
    assert (found["label"], found["score"]) == (label, pytest.approx(0.9, abs=0.001))


def test_pose_gives_the_midpoint_of_its_confident_ankles(tmp_path):
    left, _, right, bottom = BOX
    row = LAYOUTS["yolov8 pose"][0]["output0"].copy()
    for score, where in ((0.8, 0.5 * (left + right)), (0.3, 0.75 * left + 0.25 * right)):
        row[0, -1, 2] = score  # of the right ankle
        path = constant_model(tmp_path / "m.onnx", {"output0": row}, metadata=LAYOUTS["yolov8 pose"][2])
        (found,) = detector(path).detect(WIDE)
        assert found["foot"] == pytest.approx([where * 1.5 - 0.5, (bottom - 16.0) * 1.5 - 0.5], abs=0.01)
    row[0, [-1, -4], 2] = 0.1
    path = constant_model(tmp_path / "m.onnx", {"output0": row}, metadata=LAYOUTS["yolov8 pose"][2])
    assert "foot" not in detector(path).detect(WIDE)[0]


def test_turned_box_has_its_corners_and_the_upright_box_around_them(tmp_path):
    """20 x 10 px in the input, turned by 30 degrees about (32, 32): corners by the naive rotation."""
    angle = np.radians(30.0)
    rows = columns_with([32.0, 32.0, 20.0, 10.0, *CLASSES, angle])
    path = constant_model(tmp_path / "m.onnx", {"o": rows}, metadata={**ULTRALYTICS, "task": "obb"})
    (found,) = detector(path).detect(np.zeros((64, 64, 3), np.uint8))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    corners = np.array([turn @ corner for corner in [(-10, -5), (10, -5), (10, 5), (-10, 5)]]) + 31.5
    assert np.array(found["outline"]) == pytest.approx(corners, abs=0.01)
    assert found["box"] == pytest.approx([*corners.min(axis=0), *corners.max(axis=0)], abs=0.01)
    assert (found["u"], found["v"]) == pytest.approx((31.5, 31.5), abs=0.01)


def test_turned_neighbours_whose_upright_boxes_overlap_are_two(tmp_path):
    """Two parked lorries side by side, at 45 degrees: the upright boxes share most of their area, they none."""
    rows = np.zeros((1, 84, 8), np.float32)
    for place, shift in ((2, 0.0), (3, 5.0)):
        rows[0, place] = [30.0 + shift, 30.0 - shift, 40.0, 6.0, *CLASSES, np.pi / 4]
    path = constant_model(
        tmp_path / "m.onnx", {"o": rows.transpose(0, 2, 1).copy()}, metadata={**ULTRALYTICS, "task": "obb"}
    )
    assert len(detector(path).detect(np.zeros((64, 64, 3), np.uint8))) == 2


def test_mask_gives_the_outline_of_the_thing(tmp_path):
    """The mask is the left half of the box: its outline ends in the middle."""
    prototypes = np.full((1, 32, 16, 16), -1.0, np.float32)
    prototypes[0, 0, :, :6] = 1.0  # columns 0 to 24 of the input
    rows = columns_with([24.0, 32.0, 32.0, 16.0, *CLASSES, 1.0, *np.zeros(31)])
    path = constant_model(
        tmp_path / "m.onnx", {"o": rows, "p": prototypes}, metadata={**ULTRALYTICS, "task": "segment"}
    )
    (found,) = detector(path).detect(np.zeros((64, 64, 3), np.uint8))
    outline = np.array(found["outline"])
    assert [*outline.min(axis=0), *outline.max(axis=0)] == pytest.approx([7.5, 23.5, 23.5, 39.5], abs=0.01)


@pytest.mark.parametrize("name", ASKED)
def test_what_only_the_user_knows_is_asked_with_the_candidates(tmp_path, name):
    outputs, metadata, asked = ASKED[name]
    path = constant_model(tmp_path / "m.onnx", outputs, metadata=metadata)
    with pytest.raises(DetectorError, match=rf"^\[vision\] model m\.onnx: [^\n]*{asked}[^\n]*$"):
        detector(path)


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_exotic_is_refused_by_name_with_what_helps(tmp_path, name):
    outputs, inputs, named = REFUSED[name]
    path = constant_model(tmp_path / "m.onnx", outputs, inputs=inputs)
    with pytest.raises(DetectorError, match=rf"^\[vision\] model m\.onnx: [^\n]*{named}[^\n]*$"):
        detector(path)


@pytest.mark.parametrize(
    ("outputs", "names", "candidates"),
    [
        (np.zeros((1, 300, 6), np.float32), "['a', 'b']", r"yolov10 \| rtdetr"),
        (np.zeros((0, 7), np.float32), "['a', 'b']", r"yolonas \| nms7"),
    ],
)
def test_twins_without_a_detection_are_asked_after_fifty_pictures(tmp_path, outputs, names, candidates):
    path = constant_model(tmp_path / "m.onnx", {"o": outputs}, metadata={"names": names})
    model = detector(path)
    assert re.search(rf"a picture with a detection will tell its layout; else .* = {candidates} \(", model.described())
    assert [model.detect(WIDE) for _ in range(49)] == [[]] * 49
    with pytest.raises(DetectorError, match=rf"after 50 pictures without a detection .* model_format = {candidates}"):
        model.detect(WIDE)


def test_twins_are_told_by_the_first_picture_with_a_detection(tmp_path):
    """The grey picture of the start shows nothing; a light in a picture gives a row, in pixels."""
    from model_graphs import light_row_model

    path = light_row_model(tmp_path / "m.onnx", [*BOX, 0.9, 1.0], rows=300)
    model = detector(path)
    assert model.detect(np.full_like(WIDE, 0)) == []
    (found,) = model.detect(np.full_like(WIDE, 255))
    assert found["box"] == pytest.approx([edge - 0.5 for edge in TRUE], abs=0.01)


def test_rfdetr_of_the_official_weights_has_no_background(tmp_path):
    rows = np.full((1, 300, 91), -9.0, np.float32)
    rows[0, 2, 90] = 3.0
    dets = rows_with(centred(in_input("stretch") / 64.0), 300)
    path = constant_model(tmp_path / "m.onnx", {"dets": dets, "labels": rows}, inputs=[picture_input(name="input")])
    (found,) = detector(path).detect(WIDE)
    assert found["label"] == "90"


def torchvision_outputs(label):
    boxes = in_input("stretch")[None].astype(np.float32)
    return {"boxes": boxes, "labels": np.array([label]), "scores": np.array([0.9], np.float32)}


@pytest.mark.parametrize(("background", "label"), [("none", "car"), ("first", "person")])
def test_background_slot_is_overridden(tmp_path, background, label):
    *_, settings = LAYOUTS["torchvision"]
    outputs = {
        "boxes": in_input("stretch")[None].astype(np.float32),
        "labels": np.array([1]),
        "scores": np.array([0.9], np.float32),
    }
    path = constant_model(tmp_path / "m.onnx", outputs, metadata=NAMES, inputs=[picture_input((3, 64, 64))])
    (found,) = detector(path, model_background=background, **settings).detect(WIDE)
    assert found["label"] == label


def test_background_slot_is_no_detection(tmp_path):
    outputs = {
        "boxes": in_input("stretch")[None].astype(np.float32),
        "labels": np.array([0]),
        "scores": np.array([0.9], np.float32),
    }
    path = constant_model(tmp_path / "m.onnx", outputs, metadata=NAMES, inputs=[picture_input((3, 64, 64))])
    assert detector(path).detect(WIDE) == []


@pytest.mark.parametrize(
    ("resize", "box"),
    [("letterbox", BOX), ("letterbox_topleft", in_input("letterbox_topleft")), ("stretch", in_input("stretch"))],
)
def test_resize_is_overridden(tmp_path, resize, box):
    path = constant_model(tmp_path / "m.onnx", {"o": columns_with([*centred(box), *CLASSES])}, metadata=NAMES)
    (found,) = detector(path, model_resize=resize).detect(WIDE)
    assert (found["u"], found["v"]) == pytest.approx((35.5, 22.0), abs=0.01)


MEANS, DEVIATIONS = (10.0, 20.0, 30.0), (2.0, 4.0, 5.0)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, (200 / 255, 100 / 255, 50 / 255)),
        ({"model_normalize": "none"}, (200, 100, 50)),
        (
            {"model_normalize": "imagenet"},
            ((200 - 123.675) / 58.395, (100 - 116.28) / 57.12, (50 - 103.53) / 57.375),
        ),
        (
            {"model_normalize": "imagenet", "model_input": "bgr"},
            ((50 - 103.53) / 57.375, (100 - 116.28) / 57.12, (200 - 123.675) / 58.395),
        ),
        ({"model_normalize": (MEANS, DEVIATIONS)}, (95.0, 20.0, 4.0)),
        ({"model_normalize": (MEANS, DEVIATIONS), "model_input": "bgr"}, (20.0, 20.0, 34.0)),
        ({"model_input": "bgr255"}, (50, 100, 200)),
    ],
)
def test_normalization_reaches_the_model(tmp_path, settings, expected):
    """The graph answers the first pixel's three values as a box's first three numbers; red 200, green 100, blue 50."""
    from model_graphs import echo_model

    path = echo_model(tmp_path / "m.onnx")
    seen = []
    model = detector(path, **settings)
    model._decoded = lambda outputs: seen.append(outputs["output0"][0, :3, 0].copy()) or empty()
    model.detect(np.full((64, 64, 3), (50, 100, 200), np.uint8))
    assert seen[-1] == pytest.approx(expected, abs=1e-4)


def empty():
    from fwav_companion.vision.detectors.model.boxes import Boxes

    return Boxes(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.int64))


@pytest.mark.parametrize("kind", [TensorProto.FLOAT16, TensorProto.UINT8])
def test_half_precision_and_levels_are_fed_as_they_are_declared(tmp_path, kind):
    path = constant_model(tmp_path / "m.onnx", LAYOUTS["yolov8"][0], metadata=NAMES, inputs=[picture_input(kind=kind)])
    (found,) = detector(path).detect(WIDE)
    assert found["u"] == pytest.approx(35.5, abs=0.01)


def test_the_size_that_a_file_leaves_open_is_asked(tmp_path):
    inputs = [picture_input((1, 3, "height", "width"))]
    path = constant_model(tmp_path / "m.onnx", LAYOUTS["yolov8"][0], metadata=NAMES, inputs=inputs)
    with pytest.raises(DetectorError, match=r"size is left open; set \[vision\] model_size = \[width, height\]"):
        detector(path)
    assert detector(path, model_size=(64, 64)).detect(WIDE)[0]["u"] == pytest.approx(35.5, abs=0.01)
    fixed = constant_model(tmp_path / "f.onnx", LAYOUTS["yolov8"][0], metadata=NAMES)
    with pytest.raises(DetectorError, match=r"its size is 64 x 64; accepted: model_size = \[64, 64\] or auto"):
        detector(fixed, model_size=(32, 64))
