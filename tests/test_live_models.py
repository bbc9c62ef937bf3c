"""A model whose layout only its first detection tells, in the daemon as a user runs it."""

import json
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from sites import Site

sys.path.insert(0, str(Path(__file__).parent / "vision"))
from model_graphs import constant_model

MOST_PICTURES = 50


@pytest.fixture
def site(tmp_path):
    site = Site(tmp_path)
    yield site
    site.close()


@pytest.mark.timeout(120)
def test_a_layout_that_fifty_pictures_do_not_tell_stops_vision_with_an_error(site: Site):
    """Rows of seven numbers are of two families; this model never gives one."""
    constant_model(site.folder / "m.onnx", {"o": np.zeros((0, 7), np.float32)}, metadata={"names": "['a', 'b']"})
    pictures = site.folder / "pictures"
    pictures.mkdir()
    cv2.imwrite(str(pictures / "0.png"), np.zeros((480, 640), np.uint8))
    stamps = pictures / "stamps.jsonl"
    lines = [json.dumps({"file": "0.png", "time_monotonic": 1.0 + 0.1 * i}) + "\n" for i in range(MOST_PICTURES)]
    stamps.write_text("".join(lines[:-1]))
    site.replace("[rates]", '[vision]\nsource = "pictures"\ndetector = "onnx"\nmodel = "m.onnx"\n[rates]')
    with site.service() as service:
        service.wait_for("pictures arrive from", within_s=60.0)
        assert "ERROR" not in service.said
        with stamps.open("a") as file:
            file.write(lines[-1])
        service.wait_for("detection stops until this is changed: .vision. model m.onnx: after 50 pictures")
        (line,) = [line for line in service.said.splitlines() if "detection stops" in line]
        assert "ERROR" in line
        assert "model_format = yolonas | nms7" in line
        said_s = time.monotonic()
        while site.status()["time_monotonic"] < said_s:  # written once a second, and check reads it
            time.sleep(0.05)
        command = [sys.executable, "-m", "fwav_companion", "check", "--config", "fwav-companion.toml", "--json"]
        checked = subprocess.run(command, capture_output=True, text=True, cwd=site.folder, timeout=60)
        findings = {finding["code"]: finding for finding in json.loads(checked.stdout.splitlines()[-1])["findings"]}
        assert checked.returncode == 1
        assert findings["vision_stopped"]["level"] == "ERROR"
        assert "yolonas | nms7" in findings["vision_stopped"]["problem"]
        assert service.stop() == 0
