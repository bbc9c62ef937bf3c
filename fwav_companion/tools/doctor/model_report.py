"""SHELL: opens the configured model as the vision process does, and reports how it is read and what it costs."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fwav_companion.config import Config
from fwav_companion.errors import CompanionError, InputFileError, UserError
from fwav_companion.libraries import is_installed
from fwav_companion.memory_limit import MOST_VISION, VISION_SHARE, is_want_of_memory, limit_of, limited
from fwav_companion.pixels import read_pixels
from fwav_companion.tools.doctor.evidence import ModelReport

if TYPE_CHECKING:
    from fwav_companion.vision.images import Pixels

SUFFIXES: Final = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp")
MODULES: Final = ("numpy", "cv2", "onnxruntime")


def model_report(config: Config) -> ModelReport | None:
    """How the model of [vision] is read; None without one, or without the libraries that it needs."""
    if config.vision is None or config.vision.detector != "onnx" or not all(map(is_installed, MODULES)):
        return None
    from fwav_companion.service.service_factory import make_vision_task
    from fwav_companion.vision.detectors.onnx import OnnxDetector

    try:
        task = make_vision_task(config)
        if task is None:
            return None
        with limited(limit_of(VISION_SHARE, MOST_VISION)):
            detector = OnnxDetector(task)
            pixels = _first_picture(task.source, detector.input_size)
            started_s = time.perf_counter()
            detector.detect(pixels)
            seconds = time.perf_counter() - started_s
    except (CompanionError, UserError) as error:
        return ModelReport(error=str(error))
    except Exception as error:
        if not is_want_of_memory(error):
            raise
        return ModelReport(error="out of memory, as the vision process would be: a smaller picture or model is needed")
    columns, rows = task.model_tiles
    passes = columns * rows + (columns * rows > 1)
    return ModelReport(reading=detector.described(), problem=detector.problem, passes=passes, seconds=seconds)


def _first_picture(source: str, size: tuple[int, int]) -> Pixels:
    """The first picture of a folder or video; a grey one of other sources, which `run` may have open."""
    import cv2
    import numpy as np

    path = Path(source)
    files = sorted(each for each in path.iterdir() if each.suffix.lower() in SUFFIXES) if path.is_dir() else []
    pixels: object = None
    if files:
        with suppress(InputFileError):
            pixels = read_pixels(files[0], as_stored=False)
    elif path.is_file():
        capture = cv2.VideoCapture(str(path))
        _, pixels = capture.read()
        capture.release()
    grey: Pixels = np.full((size[1], size[0], 3), 114, np.uint8)
    return grey if pixels is None else np.asarray(pixels, np.uint8)
