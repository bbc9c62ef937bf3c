"""COLMAP's model in a world of its own, aligned by the pictures' positions. Truth: pymap3d's and scipy's geometry."""

from __future__ import annotations

import json
import random
from contextlib import suppress
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from fwav_companion.cli.main import main
from fwav_companion.errors import InputFileError
from fwav_companion.photographs.colmap import parse_colmap
from sitl_mock.maker_tags import TruePicture
from tests.support.maker_pictures import FOCAL, HEIGHT, WIDTH, ned_from_camera, place_below, true_picture, write_picture

REMARKS = "# Image list with two lines of data per image:\n#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"


def flight(rng: np.random.Generator, count: int, *, on_line: bool = False) -> list[TruePicture]:
    pictures = []
    for number in range(count):
        north, east = 30.0 * number, 0.0 if on_line else 60.0 * (number % 2) + rng.uniform(-5, 5)
        lat, lon, _ = pymap3d.ned2geodetic(north, east, 0, 47.0, 11.0, 0)
        pictures.append(true_picture(rng, lat=float(lat), lon=float(lon), above_takeoff=80.0, alt_amsl=480.0))
    return pictures


def write_model(folder: Path, pictures: list[TruePicture], rng: np.random.Generator) -> Path:
    """The pictures with tags whose angles are wrong, and the model in a world that is turned, scaled and moved."""
    turn, factor, shift = Rotation.random(random_state=int(rng.integers(1 << 30))), 0.037, rng.uniform(-9, 9, 3)
    lines = [REMARKS.rstrip()]
    for number, picture in enumerate(pictures):
        write_picture(folder / f"{number}.jpg", "dji_rtk", _turned(picture))
        ned = np.array(pymap3d.geodetic2ned(picture.lat, picture.lon, picture.ellipsoid, 47.0, 11.0, 0.0))
        centre = factor * turn.apply(ned) + shift
        camera_from_world = (turn * Rotation.from_matrix(ned_from_camera(picture))).inv()
        x, y, z, w = camera_from_world.as_quat()
        t = -camera_from_world.apply(centre)
        lines += [f"{number + 1} {w} {x} {y} {z} {t[0]} {t[1]} {t[2]} 7 {number}.jpg", ""]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    camera = f"7 PINHOLE {WIDTH} {HEIGHT} {FOCAL} {FOCAL} {WIDTH / 2} {HEIGHT / 2}\n"
    (folder / "cameras.txt").write_text("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n" + camera)
    return folder / "images.txt"


def _turned(picture: TruePicture) -> TruePicture:
    from dataclasses import replace

    return replace(picture, yaw=picture.yaw + 40.0, pitch=-45.0)


def test_locate_by_a_colmap_model_gives_the_true_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(4)
    pictures = flight(rng, 6)
    model = write_model(tmp_path, pictures, rng)
    lat, lon, _ = place_below(pictures[2], 1500.0, 1800.0)
    names = [str(tmp_path / f"{number}.jpg") for number in range(6)]
    (tmp_path / "pixels.csv").write_text("file,u,v,label\n2.jpg,14.6,17.6,t\n")  # 40 x 30 pixels stand for 4000 x 3000
    words = ["--pixels", str(tmp_path / "pixels.csv"), "--poses", str(model), "--ground-alt", "400", "--json"]
    assert main(["locate", *names, *words]) == 0
    answers = json.loads(capsys.readouterr().out.splitlines()[-1])
    (target,) = answers["targets"]
    error = pymap3d.geodetic2ned(target["lat"], target["lon"], 0, lat, lon, 0)
    assert np.hypot(error[0], error[1]) < 3.0  # half of a small pixel is 50 of the large ones: 1.5 m
    assert any("aligned to the positions of 6 pictures" in note for note in answers["assumed"])
    assert any("COLMAP's cameras.txt" in note for note in answers["assumed"])


def test_detect_writes_the_poses_of_a_colmap_model(tmp_path: Path) -> None:
    import csv

    rng = np.random.default_rng(5)
    pictures = flight(rng, 5)
    model = write_model(tmp_path, pictures, rng)
    out = tmp_path / "poses.csv"
    assert main(["detect", str(tmp_path), "--poses", str(model), "--poses-out", str(out)]) == 0
    for row, picture in zip(csv.DictReader(out.read_text().splitlines()), pictures, strict=True):
        given = Rotation.from_euler("ZYX", [float(row[f"{n}_deg"]) for n in ("yaw", "pitch", "roll")], degrees=True)
        truth = Rotation.from_euler("ZYX", [picture.yaw, picture.pitch, picture.roll], degrees=True)
        assert np.degrees((truth.inv() * given).magnitude()) < 0.02
        assert row["alt_datum"] == "ellipsoid"
        assert float(row["alt"]) == pytest.approx(picture.ellipsoid, abs=0.05)


@pytest.mark.parametrize(("count", "on_line", "said"), [(2, False, "at least 3"), (6, True, "near one line")])
def test_colmap_model_that_cannot_be_aligned_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], count: int, on_line: bool, said: str
) -> None:
    rng = np.random.default_rng(6)
    model = write_model(tmp_path, flight(rng, count, on_line=on_line), rng)
    words = ["--poses", str(model), "--poses-out", str(tmp_path / "poses.csv")]
    assert main(["detect", str(tmp_path), *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error


def test_colmap_files_that_are_mutated_give_a_model_or_one_line() -> None:
    rng = random.Random(3)
    good = REMARKS + "".join(f"{i} 1 0 0 0 {i} 2 3 1 {i}.jpg\n1 2 3\n" for i in range(5))
    lens = "1 OPENCV 4000 3000 2666 2666 2000 1500 0.1 0 0 0\n2 SIMPLE_RADIAL 400 300 266 200 150 0.1\n"
    for _ in range(200):
        texts = []
        for text in (good, lens):
            mutated = list(text)
            for _ in range(rng.randint(1, 12)):
                mutated[rng.randrange(len(mutated))] = rng.choice([" ", "\n", "", "nan", "-", "9" * 400, "x", "\0"])
            texts.append("".join(mutated)[: rng.randrange(1, len(mutated))])
        with suppress(InputFileError):
            assert parse_colmap(texts[0], texts[1], "images.txt").images
