"""The parameters of the vision process from [vision], and the meaning of its stamps."""

import msgspec
import pytest

from fwav_companion.config import parse
from fwav_companion.errors import ConfigError
from fwav_companion.service.service_factory import make_vision_task
from fwav_companion.vision.task import VisionTask

CAMERA = '[camera]\ncalibration = "camera.yaml"\n'


def config(*vision: str):
    return parse(CAMERA + "[vision]\n" + "\n".join(vision), "/flights/one/flight.toml")


@pytest.mark.parametrize(
    ("source", "reported"),
    [
        ("frames", "/flights/one/frames"),
        ("../video.avi", "/flights/one/../video.avi"),
        ("/srv/frames", "/srv/frames"),
        ("/dev/video2", "/dev/video2"),
        ("rtsp://camera.local/main", "rtsp://camera.local/main"),
        ("libcamera:1", "libcamera:1"),
    ],
)
def test_paths_are_relative_to_the_file_and_other_sources_are_not(source: str, reported: str):
    assert make_vision_task(config(f'source = "{source}"')) == VisionTask(reported)


def test_a_detectors_settings_go_along():
    task = make_vision_task(config('source = "x"', 'detector = "aruco"', 'aruco_dictionary = "6x6_250"'))
    assert (task.detector, task.aruco_dictionary) == ("aruco", "6x6_250")
    assert make_vision_task(config('detector = "color"', "color_hue_deg = 240.0")).color_hue_deg == 240.0


def test_a_models_settings_are_read_from_the_configuration_and_reach_the_vision_process():
    """The task travels as JSON."""
    lines = [
        'source = "x"',
        'model_format = "dfine"',
        "model_size = [640, 384]",
        'model_resize = "stretch"',
        "model_normalize = [[103.5, 116.3, 123.7], [57.4, 57.1, 58.4]]",
        'model_background = "first"',
        "model_tiles = [4, 3]",
        "model_sigma = [0.4, 0.02]",
        "model_bias = [0.0, 0.05]",
    ]
    task = make_vision_task(config(*lines))
    assert (task.model_size, task.model_tiles, task.model_background) == ((640, 384), (4, 3), "first")
    assert task.model_normalize == ((103.5, 116.3, 123.7), (57.4, 57.1, 58.4))
    assert msgspec.json.decode(msgspec.json.encode(task), type=VisionTask) == task
    for wrong in ("model_size = [640]", 'model_normalize = "mean"', "model_tiles = [0, 1]", 'model_format = "yolo"'):
        with pytest.raises(ConfigError, match=wrong.partition(" ")[0]):
            config('source = "x"', wrong)


def test_without_vision_there_is_nothing_to_do():
    assert make_vision_task(parse(CAMERA, "flight.toml")) is None


def test_an_unknown_dictionary_is_an_error():
    with pytest.raises(ConfigError, match="aruco_dictionary"):
        config('aruco_dictionary = "8x8_50"')
