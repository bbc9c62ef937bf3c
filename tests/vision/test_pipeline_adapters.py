"""The example senders of pipelines, against pretended modules made from their public documentation."""

import sys
import time
from enum import IntFlag
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from adapters import SHOWN, arrived, first_sent, message

BEFORE_NS = 30_000_000
"""Time from the capture until the detection arrives."""


class Chain:
    """A linked list as pyds gives it."""

    def __init__(self, data, following=None):
        self.data, self.next = data, following


class Cast:
    @staticmethod
    def cast(data):
        return data


class Buffer:
    def __init__(self, pts, data=b""):
        self.pts, self.data = pts, data

    def get_size(self):
        return len(self.data)

    def extract_dup(self, start, size):
        return self.data[start : start + size]


class Pipeline:
    """A pipeline that began ten seconds ago; its appsink gives pictures of 638 x 480, whose rows are padded."""

    base_ns = time.monotonic_ns() - 10_000_000_000
    description = ""

    def set_state(self, state):
        assert state == "playing"

    def get_base_time(self):
        return self.base_ns

    def get_by_name(self, name):
        assert f"name={name}" in self.description
        return self

    def get_static_pad(self, name):
        assert name == "sink"
        return self

    def add_probe(self, kind, probe, *words):
        self.probe, self.words = probe, words

    def get_bus(self):
        return self

    def timed_pop_filtered(self, timeout, kinds):
        self.probe(self, SimpleNamespace(get_buffer=lambda: Buffer(self.pts())), *self.words)

    def pts(self):
        return time.monotonic_ns() - BEFORE_NS - self.base_ns

    def emit(self, signal):
        assert signal == "pull-sample"
        rows = np.zeros((480, 638 * 3 + 2), np.uint8)
        left, top, right, bottom = map(int, SHOWN)
        rows[top:bottom, 3 * left : 3 * right] = 255
        rows[:, -2:] = 255  # the padding
        shape = {"width": 638, "height": 480}
        structure = SimpleNamespace(get_value=shape.get)
        caps = SimpleNamespace(get_structure=lambda _number: structure)
        buffer = Buffer(self.pts(), rows.tobytes())
        return SimpleNamespace(get_buffer=lambda: buffer, get_caps=lambda: caps)


class MessageType(IntFlag):
    ERROR = 1
    EOS = 2


def parse_launch(description):
    Pipeline.description = description
    return Pipeline()


def object_meta(number):
    left, top, right, bottom = SHOWN
    place = SimpleNamespace(left=left, top=top, width=right - left, height=bottom - top)
    return SimpleNamespace(rect_params=place, confidence=0.9, object_id=number, obj_label="car")


def batch_meta(_hash):
    things = Chain(object_meta(7), Chain(object_meta(0xFFFFFFFFFFFFFFFF)))
    frame = SimpleNamespace(
        obj_meta_list=things,
        buf_pts=Pipeline().pts(),
        frame_num=37,
        source_frame_width=640,
        source_frame_height=480,
    )
    return SimpleNamespace(frame_meta_list=Chain(frame))


@pytest.fixture
def modules(monkeypatch):
    gst = SimpleNamespace(
        init=lambda _words: None,
        parse_launch=parse_launch,
        State=SimpleNamespace(PLAYING="playing"),
        PadProbeType=SimpleNamespace(BUFFER=1),
        PadProbeReturn=SimpleNamespace(OK=1),
        MessageType=MessageType,
        CLOCK_TIME_NONE=-1,
    )
    node = type("Node", (), {"__init__": lambda _self, _name: None, "create_subscription": lambda *_words: None})
    for name, content in {
        "gi": {"require_version": lambda _name, _version: None},
        "gi.repository": {"Gst": gst},
        "pyds": {
            "gst_buffer_get_nvds_batch_meta": batch_meta,
            "NvDsFrameMeta": Cast,
            "NvDsObjectMeta": Cast,
        },
        "rclpy": {},
        "rclpy.node": {"Node": node},
        "rclpy.qos": {"qos_profile_sensor_data": None},
        "vision_msgs": {},
        "vision_msgs.msg": {"Detection2DArray": object},
    }.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)


def test_deepstream_sends_with_the_buffers_own_time_and_the_trackers_ids(modules, monkeypatch):
    pipeline = "nvarguscamerasrc ! nvinfer ! nvtracker ! fakesink name=found"
    frame, age_s = first_sent(monkeypatch, "deepstream", pipeline)
    assert 0.03 <= age_s < 10.0
    assert frame.size == (640, 480)
    first, second = frame.detections
    assert (first.u, first.v, first.label, first.score) == (119.5, 119.5, "car", 0.9)
    assert first.box == (99.5, 59.5, 139.5, 179.5)
    assert (first.detector_id, second.detector_id) == (7, None)


def test_gstreamer_sends_with_the_buffers_own_time_what_it_finds_in_unpadded_rows(modules, monkeypatch):
    """The picture has a lamp; its rows are padded with white, of which none is found."""
    frame, age_s = first_sent(monkeypatch, "gstreamer", "v4l2src")
    assert 0.03 <= age_s < 10.0
    assert frame.size == (638, 480)
    (detection,) = frame.detections
    assert (detection.u, detection.v, detection.label, detection.score) == (119.5, 119.5, "lamp", 1.0)
    assert detection.box == (99.5, 59.5, 139.5, 179.5)


def test_ros_sends_with_the_headers_stamp(modules):
    captured = time.time() - 0.05
    stamp = SimpleNamespace(sec=int(captured), nanosec=int(captured % 1.0 * 1e9))
    left, top, right, bottom = SHOWN
    centre = SimpleNamespace(position=SimpleNamespace(x=(left + right) / 2, y=(top + bottom) / 2))

    def detection(number, *scores):
        results = [SimpleNamespace(hypothesis=SimpleNamespace(class_id=name, score=score)) for name, score in scores]
        box = SimpleNamespace(center=centre, size_x=right - left, size_y=bottom - top)
        return SimpleNamespace(bbox=box, results=results, id=number)

    detections = SimpleNamespace(
        header=SimpleNamespace(stamp=stamp),
        detections=[detection("12", ("person", 0.2), ("car", 0.9)), detection("a-b", ("car", 0.8)), detection("")],
    )
    frame, age_s = arrived(message("ros2", "frame_of", detections, [640, 480]))
    assert 0.04 <= age_s < 10.0
    assert [each.detector_id for each in frame.detections] == [12, None, None]
    assert [each.label for each in frame.detections] == ["car", "car", ""]
    assert frame.detections[0].box == (99.5, 59.5, 139.5, 179.5)
    empty = SimpleNamespace(header=detections.header, detections=[])
    assert arrived(message("ros2", "frame_of", empty, [640, 480]))[0].detections == ()
