"""The handbook's example of a source: its program writes into a pipe, the camera process finds what it drew."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fwav_companion.vision.detectors import make_detector
from fwav_companion.vision.images import SourceLostError
from fwav_companion.vision.sources import open_source
from fwav_companion.vision.task import VisionTask

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "pictures_into_a_pipe.py"
WITHIN_S = 60.0
"""A hang, not slowness."""


def read(task: VisionTask):
    """The next picture of a source that is opened for it and closed again; opened again where the pipe is torn."""
    deadline = time.monotonic() + WITHIN_S
    while time.monotonic() < deadline:
        source = open_source(task)
        try:
            return source.read(WITHIN_S)
        except SourceLostError:  # as the worker does
            time.sleep(0.05)
        finally:
            source.close()
    raise TimeoutError(task.source)


def test_a_program_that_writes_into_a_pipe_is_a_camera_and_survives_its_reader(tmp_path):
    pipe = tmp_path / "camera.pipe"
    os.mkfifo(pipe)
    task = VisionTask(str(pipe), detector="color", color_hue_deg=0.0)
    with subprocess.Popen([sys.executable, str(EXAMPLE), str(pipe)]) as program:
        try:
            pictures = [read(task), read(task)]  # the service ended and was started again
        finally:
            program.kill()
    for picture in pictures:
        (found,) = make_detector(task).detect(picture.pixels)
        assert (found["u"], found["v"]) == pytest.approx((400.0, 200.0), abs=0.01)
        assert picture.exposure_s == 0.002
        assert picture.number is not None
    assert pictures[0].stamp["time_monotonic"] < pictures[1].stamp["time_monotonic"]
