"""The example senders for detectors of others, against pretended modules made from their public documentation."""

import ast
import importlib.util
import io
import sys
import time
import tokenize
from types import ModuleType, SimpleNamespace

import cv2
import numpy as np
import pytest
from adapters import EXAMPLES, SHOWN, first_sent


class Request:
    def __init__(self, shape):
        self.shape, self.held = shape, True

    def get_metadata(self):
        return metadata()

    def make_array(self, name):
        assert self.held
        return np.zeros(self.shape[name], np.uint8)

    def save(self, name, path):
        cv2.imwrite(path, self.make_array(name))

    def release(self):
        self.held = False


def metadata():
    return {"SensorTimestamp": time.monotonic_ns() - 30_000_000, "ExposureTime": 2000}


class Picamera2:
    def __init__(self, number=0):
        self.number = number

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def create_video_configuration(self, **streams):
        return streams

    create_preview_configuration = create_video_configuration

    def configure(self, streams):
        self.shape = {name: (stream["size"][1], stream["size"][0], 3) for name, stream in streams.items()}

    def start(self):
        self.started = True

    def capture_request(self):
        return Request(self.shape)

    def close(self):
        self.started = False

    def capture_metadata(self):
        return metadata()


class Hailo:
    def __init__(self, path):
        assert path == "model"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def get_input_shape(self):
        return (320, 320, 3)

    def run(self, picture):
        assert picture.shape == (320, 320, 3)
        left, top, right, bottom = SHOWN
        row = np.array([top / 480, left / 640, bottom / 480, right / 640, 0.9], np.float32)
        return [np.zeros((0, 5)), [row, np.array([0, 0, 1, 1, 0.1])]]


class IMX500:
    camera_num = 1
    network_intrinsics = SimpleNamespace(labels=["person", "car"])
    waits = True

    def __init__(self, path):
        assert path == "model"

    def get_outputs(self, metadata, add_batch):
        if IMX500.waits:
            IMX500.waits = False
            return None
        return [np.array([[[0.1, 0.2, 0.3, 0.4], [0, 0, 1, 1]]]), np.array([[0.9, 0.1]]), np.array([[1.0, 0.0]])]

    def convert_inference_coords(self, place, metadata, camera):
        assert camera.number == 1
        left, top, right, bottom = SHOWN
        return (left, top, right - left, bottom - top)


class Column(list):
    def tolist(self):
        return list(self)


class YOLO:
    names = {0: "person", 1: "car"}  # noqa: RUF012

    def __init__(self, path):
        assert path == "model"

    tracked = Column([7.0])

    def track(self, picture, persist, verbose):
        assert picture.shape == (480, 640, 3)
        assert (persist, verbose) == (True, False)
        boxes = SimpleNamespace(xyxy=Column([SHOWN]), conf=Column([0.9]), cls=Column([1.0]), id=self.tracked)
        return [SimpleNamespace(boxes=boxes)]


@pytest.fixture
def modules(monkeypatch):
    for name, content in {
        "picamera2": {"Picamera2": Picamera2},
        "picamera2.devices": {"Hailo": Hailo, "IMX500": IMX500},
        "ultralytics": {"YOLO": YOLO},
    }.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)


@pytest.mark.parametrize("name", ["ultralytics", "hailo", "imx500"])
def test_what_they_find_arrives_with_the_time_of_its_exposure(modules, monkeypatch, tmp_path, name):
    (tmp_path / "labels.txt").write_text("person\ncar\n")
    words = ["model", str(tmp_path / "labels.txt")] if name == "hailo" else ["model"]
    frame, age_s = first_sent(monkeypatch, name, *words)
    assert 0.03 <= age_s < 10.0
    assert (frame.exposure_s, frame.size) == (0.002, (640, 480))
    detection, *others = frame.detections
    assert (detection.u, detection.v) == pytest.approx((119.5, 119.5), abs=1e-3)
    assert detection.box == pytest.approx((99.5, 59.5, 139.5, 179.5), abs=1e-3)
    assert (detection.label, detection.score) == ("car", pytest.approx(0.9))
    assert [each.score for each in others] == ([0.1] if name == "hailo" else []), "min_score is the service's"
    assert detection.detector_id == (7 if name == "ultralytics" else None)


def test_ultralytics_without_a_tracked_thing_sends_no_id(modules, monkeypatch):
    monkeypatch.setattr(YOLO, "tracked", None)
    assert first_sent(monkeypatch, "ultralytics", "model")[0].detections[0].detector_id is None


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("detections_of_*.py")), ids=lambda path: path.stem)
def test_adapter_has_thirty_lines_of_code(path):
    text, words = path.read_text(), set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):  # a docstring
            words |= set(range(node.lineno, node.end_lineno + 1))
    layout = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
    tokens = [token for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type not in layout]
    assert len({n for token in tokens for n in range(token.start[0], token.end[0] + 1)} - words) <= 30


def test_pictures_of_a_board_have_the_size_of_the_flight(modules, tmp_path, monkeypatch):
    spec = importlib.util.spec_from_file_location("pictures_of_a_board", EXAMPLES / "pictures_of_a_board.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    monkeypatch.setattr(example, "STEP_S", 0.0)
    example.take((640, 480), tmp_path / "pictures", 3)
    names = sorted(path.name for path in (tmp_path / "pictures").iterdir())
    assert names == ["000.png", "001.png", "002.png"]
    assert cv2.imread(str(tmp_path / "pictures" / "002.png")).shape == (480, 640, 3)
