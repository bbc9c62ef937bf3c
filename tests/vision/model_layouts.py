"""One small graph with a known answer for each layout: a car at TRUE in a picture of 96 x 48, input 64 x 64."""

import numpy as np
from model_graphs import constant_model, picture_input
from onnx import TensorProto

SIZE = 64
WIDE = np.zeros((48, 96, 3), np.uint8)
TRUE = (30.0, 18.0, 42.0, 27.0)
"""Left, top, right, bottom in the picture, edge coordinates: the middle is the pixel (35.5, 22)."""
NAMES = {"names": "{0: 'person', 1: 'car', 2: 'dog'}"}
ULTRALYTICS = {**NAMES, "author": "Ultralytics", "description": "Ultralytics YOLO11n model", "stride": "32"}
CLASSES = [0.05, 0.9, 0.1]


def logit(score):
    return np.log(score / (1.0 - np.asarray(score)))


def in_input(resize):
    """The true box in the input of 64 x 64, by hand: two thirds of the size, 16 rows above, or stretched."""
    left, top, right, bottom = TRUE
    across, along = (64 / 96, 64 / 48) if resize == "stretch" else (64 / 96, 64 / 96)
    margin = 16.0 if resize == "letterbox" else 0.0
    return np.array([left * across, top * along + margin, right * across, bottom * along + margin])


def centred(edges):
    left, top, right, bottom = edges
    return np.array([(left + right) / 2, (top + bottom) / 2, right - left, bottom - top])


def rows_with(row, count, place=2):
    rows = np.zeros((1, count, len(row)), np.float32)
    rows[0, place] = row
    return rows


def columns_with(row, count=84):
    return rows_with(row, count).transpose(0, 2, 1).copy()


def yolox_raw():
    cx, cy, w, h = centred(in_input("letterbox_topleft"))
    rows = np.zeros((1, 84, 8), np.float32)
    rows[0, :, 4] = 0.01
    column, row = int(cx // 8), int(cy // 8)
    rows[0, 8 * row + column] = [cx / 8 - column, cy / 8 - row, np.log(w / 8), np.log(h / 8), 0.9, 0.1, 1.0, 0.2]
    return rows


def yolox_decoded():
    rows = rows_with([*centred(in_input("letterbox_topleft")), 0.9, 0.1, 1.0, 0.2], 84)
    rows[0, :, 0] = np.where(rows[0, :, 0] == 0, np.linspace(4, 60, 84), rows[0, :, 0])
    return rows


def ankle_points(edges):
    """17 keypoints; the ankles at a quarter and three quarters of the lower edge, of which both are confident."""
    points = np.zeros((17, 3), np.float32)
    left, _, right, bottom = edges
    points[15] = [0.75 * left + 0.25 * right, bottom, 0.9]
    points[16] = [0.25 * left + 0.75 * right, bottom, 0.8]
    return points.ravel()


BOX, STRETCHED, TOPLEFT = in_input("letterbox"), in_input("stretch"), in_input("letterbox_topleft")
SHARES = STRETCHED / SIZE
F = np.float32
SIZES = picture_input((1, 2), TensorProto.INT64, "orig_target_sizes")
NHWC = picture_input((1, 64, 64, 3), TensorProto.UINT8, "input_tensor:0")
CHW = picture_input((3, 64, 64))


def i64(*numbers):
    return np.array([numbers], np.int64)


def only(row, count, raised):
    """(1, count, 1): ``raised`` in all rows but one."""
    return np.where(np.arange(count) == row, 0.0, raised)[None, :, None].astype(F)


def graph(outputs, *, inputs=None, metadata=NAMES, label="car", **settings):
    """A row of the table: what the file holds, the label that must come out, and what the user must set."""
    return outputs, inputs, metadata, label, settings


LAYOUTS = {
    "yolov5": graph({"output0": rows_with([*centred(BOX), 0.9, 0.1, 1.0, 0.2], 252)}),
    "yolov8": graph({"output0": columns_with([*centred(BOX), *CLASSES])}),
    "yolov8 metadata": graph(
        {"output0": columns_with([*centred(BOX), *CLASSES])}, metadata={**ULTRALYTICS, "task": "detect"}
    ),
    "yolov8 transposed": graph({"output0": rows_with([*centred(BOX), *CLASSES], 84)}),
    "yolov8 pose": graph(
        {"output0": columns_with([*centred(BOX), 0.9, *ankle_points(BOX)])},
        metadata={**ULTRALYTICS, "names": "{0: 'person'}", "task": "pose", "kpt_shape": "[17, 3]"},
        label="person",
    ),
    "yolov8 obb": graph(
        {"output0": columns_with([*centred(BOX), *CLASSES, 0.0])}, metadata={**ULTRALYTICS, "task": "obb"}
    ),
    "yolov8 segment": graph(
        {
            "output0": columns_with([*centred(BOX), *CLASSES, 1.0, *np.zeros(31)]),
            "output1": np.ones((1, 32, 16, 16), F),
        },
        metadata={**ULTRALYTICS, "task": "segment"},
    ),
    "yolov10": graph({"output0": rows_with([*BOX, 0.9, 1.0], 300)}),
    "yolo26": graph(
        {"output0": rows_with([*BOX, 0.9, 1.0], 300)}, metadata={**ULTRALYTICS, "task": "detect", "end2end": "True"}
    ),
    "yolo26 pose": graph(
        {"output0": rows_with([*BOX, 0.9, 0.0, *ankle_points(BOX)], 300)},
        metadata={**ULTRALYTICS, "names": "{0: 'person'}", "task": "pose", "kpt_shape": "[17, 3]", "end2end": "True"},
        label="person",
    ),
    "yolo26 obb, class sixth": graph(
        {"output0": rows_with([*centred(BOX), 0.9, 1.0, 0.0001], 300)}, metadata={**ULTRALYTICS, "task": "obb"}
    ),
    "yolo26 obb, angle fifth": graph(
        {"output0": rows_with([*centred(BOX), 0.0001, 0.9, 1.0], 300)}, metadata={**ULTRALYTICS, "task": "obb"}
    ),
    "two classes end to end": graph(
        {"output0": rows_with([*BOX, 0.9, 1.0], 300)}, metadata={"names": "['person', 'car']"}
    ),
    "two classes of RT-DETR": graph(
        {"output0": rows_with([*centred(SHARES), 0.1, 0.9], 300)}, metadata={"names": "['person', 'car']"}
    ),
    "RT-DETR of Ultralytics": graph({"output0": rows_with([*centred(SHARES), *CLASSES], 300)}),
    "yolox": graph({"output": yolox_raw()}),
    "yolox decoded": graph({"output": yolox_decoded()}, model_format="yolox"),
    "yolonas flat": graph({"graph2_flat_predictions": np.array([[0, *BOX, 0.9, 1]], F)}),
    "yolonas flat unnamed": graph({"output": np.array([[0, *BOX, 0.9, 1]], F)}),
    "yolonas batch": graph(
        {
            "graph2_num_predictions": i64(1),
            "graph2_pred_boxes": np.array([[BOX, np.full(4, 50.0)]], F),
            "graph2_pred_scores": np.array([[0.9, 0.8]], F),
            "graph2_pred_classes": i64(1, 0),
        }
    ),
    "yolonas raw": graph({"boxes": rows_with(BOX, 84), "scores": rows_with(CLASSES, 84)}),
    "RT-DETR, sizes": graph(
        {"labels": i64(1), "boxes": STRETCHED.reshape(1, 1, 4).astype(F), "scores": np.array([[0.9]], F)},
        inputs=[picture_input(), SIZES],
    ),
    "D-FINE, sizes baked": graph(
        {"labels": i64(1), "boxes": STRETCHED.reshape(1, 1, 4).astype(F), "scores": np.array([[0.9]], F)}
    ),
    "RT-DETR, shares": graph(
        {"labels": i64(1), "boxes": SHARES.reshape(1, 1, 4).astype(F), "scores": np.array([[0.9]], F)},
        model_format="dfine",
    ),
    "RT-DETR raw": graph(
        {
            "pred_logits": rows_with(logit(CLASSES), 300) - only(2, 300, 9.0),
            "pred_boxes": rows_with(centred(SHARES), 300),
        }
    ),
    "DETR": graph(
        {
            "logits": rows_with([0.0, np.log(27.0), 0.0, 0.0], 100) + only(2, 100, 1.0) * np.array([0, 0, 0, 9], F),
            "pred_boxes": rows_with(centred(SHARES), 100),
        },
        inputs=[picture_input(name="pixel_values"), picture_input((1, 64, 64), TensorProto.INT64, "pixel_mask")],
    ),
    "RF-DETR": graph(
        {
            "dets": rows_with(centred(SHARES), 300),
            "labels": rows_with([*logit(CLASSES), 5.0], 300) - only(2, 300, 9.0),
        },
        inputs=[picture_input(name="input")],
    ),
    "mmdeploy": graph(
        {"dets": np.array([[[*TOPLEFT, 0.9]]], F), "labels": i64(1)}, inputs=[picture_input(name="input")]
    ),
    "paddle": graph(
        {
            "multiclass_nms3_0.tmp_0": np.array([[1, 0.9, *STRETCHED], [0, 0.8, 1, 1, 9, 9]], F),
            "multiclass_nms3_0.tmp_2": np.array([1], np.int32),
        },
        inputs=[picture_input(name="image"), picture_input((1, 2), TensorProto.FLOAT, "scale_factor")],
    ),
    "torchvision": graph(
        {"boxes": STRETCHED[None].astype(F), "labels": np.array([2]), "scores": np.array([0.9], F)}, inputs=[CHW]
    ),
    "torchvision, background named": graph(
        {"boxes": STRETCHED[None].astype(F), "labels": np.array([2]), "scores": np.array([0.9], F)},
        inputs=[CHW],
        metadata={"names": "['__background__', 'person', 'car']"},
    ),
    "tf zoo": graph(
        {
            "detection_boxes": SHARES[[1, 0, 3, 2]].reshape(1, 1, 4).astype(F),
            "detection_scores": np.array([[0.9]], F),
            "detection_classes": np.array([[2.0]], F),
            "num_detections": np.array([1.0], F),
        },
        inputs=[NHWC],
    ),
    "efficientdet": graph(
        {"detections:0": np.array([[[0, *STRETCHED[[1, 0, 3, 2]], 0.9, 2]]], F)},
        inputs=[picture_input((1, 64, 64, 3), TensorProto.UINT8, "image_arrays:0")],
    ),
    "nms7": graph({"output": np.array([[0, *BOX, 1, 0.9]], F)}),
    "ssd of MLPerf": graph(
        {"bboxes": SHARES.reshape(1, 1, 4).astype(F), "labels": i64(2), "scores": np.array([[0.9]], F)}
    ),
    "ssd of OpenVINO": graph({"detection_out": np.array([[[[0, 2, 0.9, *SHARES], [-1, 0, 0, 0, 0, 0, 0]]]], F)}),
}


ONE_A_CELL = np.tile(np.array([30.0, 30.0, 4.0, 4.0, 0.1, 0.1, 0.1, 0.1], F), (1, 84, 1))
FOUR = np.zeros((1, 300, 4), F)

ASKED = {
    "YOLOv6 or YOLOX": (
        {"o": ONE_A_CELL},
        NAMES,
        r"yolov5 or yolox; set \[vision\] model_format = yolov5 \| yolox .*blue first",
    ),
    "DETR or RT-DETR": (
        {"logits": FOUR, "pred_boxes": FOUR},
        {},
        r"rtdetr or detr; set .* rtdetr \| detr .*last class",
    ),
    "RF-DETR unlabelled": (
        {"dets": FOUR, "labels": FOUR},
        {},
        r"4 class slots, unknown labels; set \[vision\] model_background =",
    ),
    "RF-DETR other labels": (
        {"dets": FOUR, "labels": FOUR},
        {"names": "['a']"},
        "4 class slots, 1 labels; set .*model_background",
    ),
    "pose bare": (
        {"o": columns_with([30, 30, 4, 4, 0.9, *np.arange(51)])},
        {},
        r"scores up to 50.*set \[vision\] model_labels",
    ),
    "obb bare": (
        {"o": columns_with([30, 30, 4, 4, 0.9, -0.7])},
        {},
        r"scores down to -0\.7.*set \[vision\] model_labels",
    ),
}
"""What the file holds, its metadata, and the question, by name."""

REFUSED = {
    "NanoDet-Plus": (
        {"o": np.zeros((1, 1360, 112), F)},
        [picture_input((1, 3, 256, 256))],
        "NanoDet-Plus .*export boxes, scores and labels",
    ),
    "NanoDet of many outputs": (
        {f"{kind}_pred_stride_{s}": np.zeros((1, 9, 8), F) for kind in ("cls", "dis") for s in (8, 16, 32)},
        None,
        "raw heads of NanoDet: .*export boxes, scores and labels",
    ),
    "raw heads of YOLOv5": (
        {"o": np.zeros((1, 3, 8, 8, 85), F)},
        None,
        "raw heads of a YOLO; export with its .*--grid",
    ),
    "raw heads of YOLOv7": ({f"o{n}": np.zeros((1, 255, n, n), F) for n in (2, 4, 8)}, None, "raw heads of a YOLO"),
    "MediaPipe": (
        {"regressors": np.zeros((1, 896, 16), F), "classificators": np.zeros((1, 896, 1), F)},
        None,
        "MediaPipe",
    ),
    "torchvision unnamed": (
        {"12": np.zeros((0, 4), F), "13": np.zeros(0, np.int64), "14": np.zeros(0, F)},
        [CHW],
        r"torchvision: export with output_names = \[\"boxes\", \"labels\", \"scores\"\]",
    ),
    "unknown": ({"o": np.zeros((1, 5, 6, 7), F)}, None, r"of no known format; accepted: .*yolov5 \| .*\| ssd"),
}
"""What the file holds, its inputs, and what the refusal says, by name."""


def written(path, name):
    """The file of a row of the table."""
    outputs, inputs, metadata, _, _ = LAYOUTS[name]
    return constant_model(path, outputs, metadata=metadata, inputs=inputs)
