"""``detect`` with a model: pictures with the boxes drawn, and the measured accuracy of the boxes."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from fwav_companion.cli.main import main

sys.path.insert(0, str(Path(__file__).parents[1] / "vision"))
from model_graphs import brightest_pixel_model

SIDE = 4
"""Side of the model's box around the brightest pixel, pixels: the input is as large as the picture."""


@pytest.fixture
def config(tmp_path):
    assert main(["init", str(tmp_path)]) == 0
    brightest_pixel_model(tmp_path / "m.onnx", channel=0)
    path = tmp_path / "fwav-companion.toml"
    path.write_text(path.read_text() + '[vision]\nsource = "pictures"\ndetector = "onnx"\nmodel = "m.onnx"\n')
    return path


def pictures_of(folder, places):
    folder.mkdir()
    for number, (u, v) in enumerate(places):
        picture = np.zeros((64, 64, 3), np.uint8)
        picture[v, u] = 255
        cv2.imwrite(str(folder / f"{number:04d}.png"), picture)
    return folder


def printed(config, folder, capsys, *words):
    capsys.readouterr()
    assert main(["detect", str(folder), "--config", str(config), *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out.splitlines()[-1])


def test_draw_writes_each_picture_with_its_box(tmp_path, config, capsys):
    folder = pictures_of(tmp_path / "pictures", [(30, 20), (10, 50)])
    assert printed(config, folder, capsys, "--draw", str(tmp_path / "drawn")) == {"frames": 2, "detections": 2}
    for number, (u, v) in enumerate([(30, 20), (10, 50)]):
        shown = cv2.imread(str(tmp_path / "drawn" / f"{number:04d}.jpg"))
        green = shown[:, :, 1].astype(int) - shown[:, :, 2]
        assert green[v - 2 : v + 3, u - 2 : u + 3].max() > 60, "a green box around the light"


@pytest.mark.parametrize("kind", ["coco", "yolo"])
def test_sigma_against_labels_recovers_jitter_and_bias(tmp_path, config, capsys, kind):
    """The truth is displaced from the light: by 0.3 px of jitter and a bias of 10 % and -5 % of the box's side."""
    rng = np.random.default_rng(5)
    jitter, bias = 0.3, np.array([0.10, -0.05])
    places = rng.integers(8, 56, (300, 2))
    folder = pictures_of(tmp_path / "pictures", places)
    truth = places - bias * SIDE - rng.normal(0.0, jitter, (300, 2))
    if kind == "coco":
        labels = tmp_path / "labels.json"
        corner = truth - SIDE / 2 + 0.5
        document = {
            "images": [{"id": 7 + i, "file_name": f"{i:04d}.png"} for i in range(300)],
            "annotations": [{"image_id": 7 + i, "bbox": [*corner[i].tolist(), SIDE, SIDE]} for i in range(300)],
        }
        labels.write_text(json.dumps(document))
    else:
        labels = tmp_path / "labels"
        labels.mkdir()
        for i, (u, v) in enumerate(truth):
            (labels / f"{i:04d}.txt").write_text(f"0 {(u + 0.5) / 64} {(v + 0.5) / 64} {SIDE / 64} {SIDE / 64}\n")
    result = printed(config, folder, capsys, "--sigma", str(labels))
    floor_px, share = result["model_sigma"]
    assert np.hypot(floor_px, share * SIDE) == pytest.approx(jitter, rel=0.2)
    assert result["model_bias"] == pytest.approx(bias, abs=0.2 * 0.1)
    assert result["lower_edge"] == pytest.approx([1.0, bias[1]], rel=0.2), "the boxes have the true size"
    corrected = config.read_text() + f"model_sigma = {result['model_sigma']}\nmodel_bias = {result['model_bias']}\n"
    config.write_text(corrected)
    out = tmp_path / "d.jsonl"
    assert (
        main(
            [
                "detect",
                str(folder / "0000.png"),
                "--config",
                str(config),
                "--out",
                str(out),
                "--start",
                "2026-05-01T09:30:00Z",
            ]
        )
        == 0
    )
    (found,) = json.loads(out.read_text())["detections"]
    assert [found["u"], found["v"]] == pytest.approx(places[0] - bias * SIDE, abs=0.1)
    assert found["sigma"] == pytest.approx([jitter, jitter], rel=0.2)


def test_sigma_without_labels_recovers_the_jitter_of_standing_things(tmp_path, config, capsys):
    rng = np.random.default_rng(6)
    places = rng.integers(30, 32, (400, 2))
    jitter = np.std(places)  # 0.5 px: whole pixels, of which two are equally likely
    result = printed(config, pictures_of(tmp_path / "pictures", places), capsys, "--sigma", "still")
    floor_px, share = result["model_sigma"]
    assert np.hypot(floor_px, share * SIDE) == pytest.approx(jitter, rel=0.1)
    assert "model_bias" not in result


def test_sigma_of_other_pictures_labels_is_refused(tmp_path, config, capsys):
    folder = pictures_of(tmp_path / "pictures", [(30, 20)])
    labels = tmp_path / "labels.json"
    labels.write_text('{"images": [], "annotations": []}')
    assert main(["detect", str(folder), "--config", str(config), "--sigma", str(labels)]) == 2
    assert "0 residuals matched a true box" in capsys.readouterr().err
    labels.write_text('{"boxes": 1}')
    assert main(["detect", str(folder), "--config", str(config), "--sigma", str(labels)]) == 2
    assert "labels.json: not labels; accepted: COCO JSON" in capsys.readouterr().err


def test_twins_that_no_picture_tells_end_with_exit_2(tmp_path, config, capsys):
    from model_graphs import constant_model

    constant_model(tmp_path / "m.onnx", {"o": np.zeros((0, 7), np.float32)}, metadata={"names": "['a']"})
    folder = pictures_of(tmp_path / "pictures", [(30, 20)] * 50)
    assert main(["detect", str(folder), "--config", str(config), "--draw", str(tmp_path / "drawn")]) == 2
    assert "model_format = yolonas | nms7" in capsys.readouterr().err


def test_sigma_of_the_lower_edge_is_measured_apart():
    """Upper and lower edges jitter alone, the lower one more; it ends 5 % of the height early."""
    from fwav_companion.tools.detect.sigma_measurement import TruthResiduals

    rng, residuals = np.random.default_rng(7), TruthResiduals()
    upper, lower, height = 1.0, 2.0, 40.0
    centre = 0.5 * np.hypot(upper, lower)
    for _ in range(2000):
        top, bottom = 100.0 + rng.normal(0.0, upper), 140.0 - 0.05 * height + rng.normal(0.0, lower)
        u = 110.0 + rng.normal(0.0, centre)
        box = [u - 10.0, top, u + 10.0, bottom]
        found = {"u": u, "v": 0.5 * (top + bottom), "sigma": [1.0, 1.0], "box": box, "label": "a", "score": 0.9}
        residuals.add([found], [(100.0, 100.0, 120.0, 140.0)], (640, 480))
    measured = residuals.result()
    assert measured.factor == pytest.approx(centre, rel=0.1)
    assert measured.lower_edge == pytest.approx((lower / centre, -0.05), rel=0.1)
