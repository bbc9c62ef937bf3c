"""200 mutations of each kind of file: the command answers, or says in one line what is wrong. Never a traceback."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from fwav_companion.cli.main import main
from sitl_mock.maker_tags import LAYOUTS
from tests.support.maker_pictures import true_picture, write_picture

MUTATIONS = 200
NASTY = (b"\0", b"\xff", b"nan", b"1e999", b"-", b"/0", b'"', b"<", b"\n", b",", b"999999999")


def mutated(rng: random.Random, good: bytes) -> bytes:
    """Bytes replaced, removed and inserted, and sometimes the end cut off."""
    data = bytearray(good)
    for _ in range(rng.randint(1, 12)):
        at = rng.randrange(len(data))
        kind = rng.randrange(3)
        if kind == 0:
            data[at] = rng.randrange(256)
        elif kind == 1:
            del data[at : at + rng.randint(1, 8)]
        else:
            data[at:at] = rng.choice(NASTY)
    return bytes(data[: rng.randrange(1, len(data))] if rng.random() < 0.2 else data)


def require_an_answer_or_one_line(capsys: pytest.CaptureFixture[str], words: list[str]) -> int:
    """Exit 0, 1 or 2; an error is one line. An exception would end the test."""
    status = main(words)
    said = capsys.readouterr()
    assert status in (0, 1, 2)
    if status == 2:
        assert said.err.count("\n") == 1, said.err
        assert "Traceback" not in said.err
    return status


@pytest.mark.parametrize("layout", ["dji_rtk", "skydio", "autel_old", "parrot"])
def test_mutated_picture_gives_an_answer_or_one_line(
    layout: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert layout in LAYOUTS
    rng = random.Random(layout)
    path = write_picture(tmp_path / "a.jpg", layout, true_picture(np.random.default_rng(1)))
    good = path.read_bytes()
    words = ["locate", str(path), "--pixel", "20,20", "--ground-alt", "400", "--json"]
    statuses = set()
    for _ in range(MUTATIONS // 4):
        path.write_bytes(mutated(rng, good))
        statuses.add(require_an_answer_or_one_line(capsys, words))
    assert {0, 2} <= statuses  # some mutations matter, and some do not


def _gcp_list(_: Path) -> bytes:
    return b"EPSG:4326\n11 47 400 20 20 a.jpg one\n11.1 47 400 22.5 20 a.jpg\n"


def _pixels(_: Path) -> bytes:
    return b"file,u,v,label\na.jpg,20,20,one\na.jpg,22.5,21,two\n"


def _geo_txt(_: Path) -> bytes:
    return b"EPSG:4326\na.jpg 11.0 47.0 480.0 30.0 10.0 2.0 0.1 0.2\n"


def _hgt(_: Path) -> bytes:
    return np.full((5, 5), 400, dtype=">i2").tobytes()


def _hgt_zip(folder: Path) -> bytes:
    with ZipFile(folder / "made.zip", "w") as archive:
        archive.writestr("N47E011.hgt", _hgt(folder))
    return (folder / "made.zip").read_bytes()


def _raster(folder: Path, suffix: str, driver: str, side: int) -> bytes:
    """A raster of one degree about the picture; DTED's smallest has 121 samples a side."""
    rasterio = pytest.importorskip("rasterio")
    copy = pytest.importorskip("rasterio.shutil").copy
    step = 1.0 / (side - 1)
    place = rasterio.Affine(step, 0.0, 11.0 - 0.5 * step, 0.0, -step, 48.0 + 0.5 * step)
    path = folder / f"made.{suffix}"
    options = {"height": side, "width": side, "count": 1, "dtype": "int16", "crs": "EPSG:4326", "transform": place}
    with rasterio.MemoryFile() as memory, memory.open(driver="GTiff", **options) as made:
        made.write(np.full((1, side, side), 400, np.int16))
        copy(made, path, driver=driver)
    return path.read_bytes()


def _geotiff(folder: Path) -> bytes:
    return _raster(folder, "tif", "GTiff", 5)


def _dted(folder: Path) -> bytes:
    return _raster(folder, "dt0", "DTED", 121)


def _gtx(_: Path) -> bytes:
    """A geoid of 3 x 4 samples on the whole globe."""
    return struct.pack(">4d2i", -90.0, -180.0, 90.0, 90.0, 3, 4) + np.full(12, 47.0, ">f4").tobytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "name", "option"),
    [
        (_gcp_list, "gcp_list.txt", "--pixels"),
        (_pixels, "pixels.csv", "--pixels"),
        (_geo_txt, "geo.txt", "--poses"),
        (_hgt, "N47E011.hgt", "--terrain"),
        (_hgt_zip, "N47E011.hgt.zip", "--terrain"),
        (_geotiff, "a.tif", "--terrain"),
        (_dted, "a.dt0", "--terrain"),
        (_gtx, "a.gtx", "--geoid"),
    ],
)
def test_mutated_file_of_an_option_gives_an_answer_or_one_line(
    make: Callable[[Path], bytes], name: str, option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = random.Random(name)
    picture = write_picture(tmp_path / "a.jpg", "dji_rtk", true_picture(np.random.default_rng(1), lat=47.5, lon=11.5))
    good, file = make(tmp_path), tmp_path / name
    words = ["locate", str(picture), option, str(file)]
    words += [] if option == "--pixels" else ["--pixel", "20,20"]
    words += [] if option == "--terrain" else ["--ground-alt", "400"]
    file.write_bytes(good)
    assert require_an_answer_or_one_line(capsys, words) == 0
    for _ in range(MUTATIONS):
        file.write_bytes(mutated(rng, good))
        require_an_answer_or_one_line(capsys, words)


def test_mutated_poses_give_an_answer_or_one_line(tmp_path: Path) -> None:
    from fwav_companion.errors import InputFileError
    from fwav_companion.recording.photograph_poses import parse_poses

    rng = random.Random(5)
    good = (
        b"# alt_datum: takeoff\nfile,frame,time_unix,lat,lon,alt,roll_deg,pitch_deg,yaw_deg,position_bias_m\n"
        b"a.jpg,0,1.5,47,11,60,0,-90,10,2.0\nb.jpg,1,2.5,47,11,61,0,-90,10,2.0\n"
    )
    for _ in range(MUTATIONS):
        text = mutated(rng, good).decode("utf-8", "replace")
        with suppress(InputFileError):
            assert parse_poses(text, "poses.csv", lambda *_: 0.0).poses


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["timed text", "transport stream"])
def test_mutated_video_gives_an_answer_or_one_line(
    layout: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("av")
    from tests.locate.test_klv import packet, write_stream
    from tests.support.made_videos import timed_text, write_mp4

    if layout == "timed text":
        said = "GPS(E: 11.0, N: 47.0, 440.0m) ReH:40.0 G.PRY (-60.0, 0.0, 10.0)"
        path = write_mp4(tmp_path / "a.mp4", [timed_text(said)] * 3)
    else:
        path = tmp_path / "a.ts"
        write_stream(path, [packet(_13=47.0, _14=11.0)] * 30)
    good, rng = path.read_bytes(), random.Random(layout)
    words = ["locate", str(path), "--at", "1", "--pixel", "20,20", "--hfov", "60", "--ground-alt", "400"]
    assert require_an_answer_or_one_line(capsys, words) == 0
    for _ in range(MUTATIONS // 2):
        path.write_bytes(mutated(rng, good))
        require_an_answer_or_one_line(capsys, words)
