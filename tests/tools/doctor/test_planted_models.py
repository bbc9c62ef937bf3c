"""What is wrong with a model is found before the flight, and how it is read is said."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from large_files import large_png, model

from fwav_companion.config import load
from fwav_companion.memory_limit import GIB
from fwav_companion.tools.doctor import model_report as model_report_module
from fwav_companion.tools.doctor.board import Board
from fwav_companion.tools.doctor.evidence import Evidence, Files
from fwav_companion.tools.doctor.finding import Level
from fwav_companion.tools.doctor.model_findings import model_findings
from fwav_companion.tools.doctor.model_report import model_report

sys.path.insert(0, str(Path(__file__).parents[2] / "vision"))
from model_graphs import constant_model
from model_layouts import BOX, NAMES, written

CONFIG = """
[camera]
calibration = "camera.yaml"
[vision]
source = "pictures"
detector = "onnx"
model = "m.onnx"
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "pictures").mkdir()
    cv2.imwrite(str(tmp_path / "pictures" / "0.png"), np.zeros((64, 64, 3), np.uint8))
    written(tmp_path / "m.onnx", "yolov8")
    return tmp_path


def findings(folder, *lines):
    path = folder / "c.toml"
    path.write_text(CONFIG + "\n".join(lines))
    config = load(path)
    evidence = Evidence(config=config, board=Board(), files=Files(model=model_report(config)), status=None)
    return {finding.code: finding for finding in model_findings(evidence)}


def test_a_sound_model_is_a_note_with_its_preset(folder):
    (finding,) = findings(folder).values()
    assert (finding.code, finding.level) == ("model_reading", Level.NOTE)
    assert finding.problem.startswith(
        "read as YOLOv8, v9, 11, 12 (model_format = yolov8), 64 x 64, rgb, 0 to 1, letterbox"
    )


def test_a_model_that_does_not_run_is_an_error_with_its_line(folder):
    (folder / "m.onnx").write_bytes(b"not a model")
    (finding,) = findings(folder).values()
    assert (finding.code, finding.level) == ("model", Level.ERROR)
    assert "m.onnx: not a model that onnxruntime loads" in finding.problem


@pytest.mark.parametrize("large", ["constant", "picture"])
def test_a_model_beyond_the_memory_of_the_vision_process_is_an_error(folder, monkeypatch, large):
    """`check` had no limit, so that it could take all memory, and called sound what does not run in flight."""
    monkeypatch.setattr(model_report_module, "MOST_VISION", GIB)
    if large == "constant":
        (folder / "m.onnx").write_bytes(model(floats=GIB))
    else:
        (folder / "pictures" / "0.png").write_bytes(large_png(30_000))
    (finding,) = findings(folder, "model_size = [64, 64]" if large == "constant" else "").values()
    assert (finding.code, finding.level) == ("model", Level.ERROR)
    assert "memory" in finding.problem


def test_implausible_outputs_are_a_warning_with_the_format_that_fits(folder):
    rows = np.array([[0, *BOX, 0.9, 2]], np.float32)
    constant_model(folder / "m.onnx", {"o": rows}, metadata=NAMES)
    finding = findings(folder, 'model_format = "nms7"')["model_implausible"]
    assert finding.level is Level.WARNING
    assert "model_format = yolonas would make sense of it" in finding.problem


def test_the_cost_of_tiles_is_said(folder):
    finding = findings(folder, "model_tiles = [3, 2]")["model_tiles"]
    assert "3 x 2 tiles and the whole picture are 7 passes of the model for each picture" in finding.problem


def test_a_model_that_is_asked_for_is_an_error_with_the_candidates(folder):
    constant_model(
        folder / "m.onnx", {"dets": np.zeros((1, 9, 4), np.float32), "labels": np.zeros((1, 9, 4), np.float32)}
    )
    assert "model_background = none | first | last" in findings(folder)["model"].problem


def test_without_a_model_nothing_is_said(folder):
    (folder / "c.toml").write_text(CONFIG.replace("onnx", "color", 1))
    assert model_report(load(folder / "c.toml")) is None
