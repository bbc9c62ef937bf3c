"""Pictures, models, videos and elevation files of strangers: one line with the library's own word, within a limit."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import rasterio
from commands import run_command
from flying import CAMERA
from large_files import large_png, model
from peak_memory import peak_growth_kb
from rasterio.transform import Affine

from fwav_companion.cli.foreign_files import foreign_files
from fwav_companion.errors import InputFileError
from fwav_companion.memory_limit import GIB, LEAST, is_want_of_memory, limit_of
from fwav_companion.photographs.embedded_tracks import embedded_telemetry
from fwav_companion.service.elevation_files import read_elevation

CONFIG = """
[[link]]
name = "autopilot"
url = "udpin://127.0.0.1:14999"
role = "autopilot"
[camera]
calibration = "camera.yaml"
[vision]
source = "unused.mp4"
"""
START = ("--start", "2026-05-01T09:30:00Z")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a configuration for tags and a picture with its stamp."""
    (tmp_path / "camera.yaml").write_text(CAMERA)
    (tmp_path / "tag.toml").write_text(CONFIG + 'detector = "apriltag"\n')
    (tmp_path / "pictures").mkdir()
    _, encoded = cv2.imencode(".png", np.zeros((480, 640, 3), np.uint8))
    add_picture(tmp_path / "pictures", encoded.tobytes())
    return tmp_path


def add_picture(folder: Path, content: bytes) -> None:
    (folder / "a.png").write_bytes(content)
    (folder / "stamps.jsonl").write_text('{"file": "a.png", "time_unix": 1790000000.0}\n')


def detected(folder: Path, pictures: str = "pictures", config: str = "tag.toml", *more: str) -> str:
    """The error's line; "" where there is none."""
    words = ("detect", pictures, "--config", config, "--out", "d.jsonl", *START, *more)
    done = run_command(*words, folder=folder)
    assert done.returncode == (2 if done.stderr else 0)
    assert len(done.stderr.splitlines()) <= 1, done.stderr
    return done.stderr.strip()


@pytest.mark.parametrize("name", [b"output0", b"images"])
def test_a_name_of_a_tensor_that_is_not_utf8_is_one_line(folder, name):
    (folder / "m.onnx").write_bytes(model().replace(name, b"\xff\xfe" + name[2:]))
    (folder / "m.toml").write_text(CONFIG + 'detector = "onnx"\nmodel = "m.onnx"\nmodel_size = [64, 64]\n')
    assert "not UTF-8" in detected(folder, config="m.toml")


def test_a_constant_beyond_the_limit_of_memory_is_one_line(folder):
    """As many bytes as a machine may have: 64 GiB."""
    (folder / "m.onnx").write_bytes(model(floats=16 * GIB))
    (folder / "m.toml").write_text(CONFIG + 'detector = "onnx"\nmodel = "m.onnx"\nmodel_size = [64, 64]\n')
    assert "needs more memory" in detected(folder, config="m.toml")


def alone(folder: Path, *words: str) -> list[str]:
    """Lines on stderr of the command in a process of its own: OpenCV reads its settings when it is loaded."""
    command = [sys.executable, "-m", "fwav_companion", *words]
    # `calibrate`, run in this process by another test, leaves OpenCV's settings in its environment.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OPENCV_")}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    return done.stderr.splitlines()


def test_a_damaged_video_is_one_line_that_quotes_its_library(folder):
    (folder / "v.mp4").write_bytes(b"\0\0\0\x18ftypmp42\0\0\0\0mp42isom" + bytes(300))
    (line,) = alone(folder, "detect", "v.mp4", "--config", "tag.toml", "--out", "d.jsonl", *START)
    assert "v.mp4: not a video" in line
    assert "moov atom not found" in line


@pytest.mark.parametrize("version", [b"\x04", b"\x09"], ids=["ends early", "not known"])
def test_a_damaged_video_of_any_error_of_its_library_is_one_line(tmp_path, version):
    """Of PyAV's errors some are neither OSError nor ValueError."""
    pytest.importorskip("av")
    path = tmp_path / "v.mkv"
    path.write_bytes(b"\x1aE\xdf\xa3\x93B\x82\x88matroskaB\x87\x81" + version + b"B\x85\x81" + version + b"\x18S\x80g")
    with pytest.raises(InputFileError, match="accepted: a video"):
        embedded_telemetry(path)


def test_a_damaged_picture_leaves_no_word_of_its_library_beside_ours(folder, capfd):
    _, encoded = cv2.imencode(".jpg", np.random.default_rng(1).integers(0, 255, (480, 640, 3), np.uint8))
    add_picture(folder / "pictures", encoded.tobytes()[:900])
    detected(folder)
    assert capfd.readouterr().err == ""


def test_a_picture_of_a_gigapixel_is_refused_by_its_header(folder):
    add_picture(folder / "pictures", large_png(30_000))
    assert alone(folder, "detect", "pictures", "--config", "tag.toml", "--out", "d.jsonl") == [
        "fwav-companion: pictures/a.png: more than 200 Mpx; accepted: at most 200 Mpx, more with --large"
    ]


def test_calibrate_refuses_a_picture_of_a_gigapixel(folder):
    """It decoded it, into a gigabyte."""
    (folder / "a.png").write_bytes(large_png(30_000))
    (line,) = alone(folder, "calibrate", "a.png", "--board", "chessboard:9x6:25mm", "--out", "c.yaml")
    assert line.startswith("fwav-companion: a.png: a damaged picture, or one too large; accepted: ")


def test_locate_asks_for_the_size_first_and_large_lifts_the_limit(folder):
    (folder / "a.png").write_bytes(large_png(15_000))
    refused = run_command("locate", "a.png", "--pixel", "1,1", folder=folder).stderr
    assert "15000 x 15000 pixels; accepted: at most 200 Mpx, more with --large" in refused
    assert "no position" in run_command("locate", "a.png", "--pixel", "1,1", "--large", folder=folder).stderr


def wasteful(inside: list[int]) -> None:
    with foreign_files("detect", large=False):
        inside.append(resource.getrlimit(resource.RLIMIT_DATA)[0])
        bytearray(64 * GIB)


def test_the_limit_of_memory_ends_with_the_command_and_large_has_none():
    before = resource.getrlimit(resource.RLIMIT_DATA)
    with foreign_files("detect", large=True):
        assert resource.getrlimit(resource.RLIMIT_DATA) == before
    inside: list[int] = []
    with pytest.raises(InputFileError, match=r"detect: out of memory, of which \d\.\d GiB are allowed; .* --large"):
        wasteful(inside)
    assert LEAST <= inside[0] <= 4 * GIB
    assert resource.getrlimit(resource.RLIMIT_DATA) == before
    assert limit_of(1e-9, GIB) == LEAST
    assert is_want_of_memory(RuntimeError("std::bad_alloc"))
    assert not is_want_of_memory(RuntimeError("a wrong shape"))


def test_a_geotiff_of_a_gigapixel_is_refused_before_its_samples_are_read(tmp_path):
    """In UTM and without a void, for which all samples were looked at: 110 kB took 1.2 GB."""
    path = tmp_path / "t.tif"
    shape = {"width": 20_000, "height": 20_000, "count": 1, "dtype": "uint8", "tiled": True, "sparse_ok": True}
    place = {"crs": "EPSG:32632", "transform": Affine(1, 0, 5e5, 0, -1, 5e6)}
    rasterio.open(path, "w", driver="GTiff", compress="deflate", **shape, **place).close()
    with pytest.raises(InputFileError, match="20000 x 20000 samples"):
        read_elevation([path])
    imports = (
        "import rasterio.vrt\nfrom contextlib import suppress\nfrom pathlib import Path\n"
        "from fwav_companion.errors import InputFileError\n"
        "from fwav_companion.service.elevation_files import read_elevation"
    )
    code = f"with suppress(InputFileError):\n    read_elevation([Path({str(path)!r})])"
    assert peak_growth_kb(imports, code) < 100_000


@pytest.mark.parametrize("source", ["/etc/passwd", "/vsicurl/http://127.0.0.1:9/t.tif"])
def test_an_elevation_file_that_names_other_files_is_refused_and_reads_none(tmp_path, source):
    """A VRT, which GDAL knew by its content, whatever the suffix."""
    path = tmp_path / "t.tif"
    path.write_text(
        '<VRTDataset rasterXSize="4" rasterYSize="4"><SRS>EPSG:4326</SRS><GeoTransform>8,1,0,47,0,-1</GeoTransform>'
        '<VRTRasterBand dataType="Byte" band="1" subClass="VRTRawRasterBand"><SourceFilename relativetoVRT="0">'
        f"{source}</SourceFilename><PixelOffset>1</PixelOffset><LineOffset>4</LineOffset></VRTRasterBand></VRTDataset>"
    )
    with pytest.raises(InputFileError, match="not recognized as being in a supported file format"):
        read_elevation([path])


ROOMLESS = {
    "no operation": ('LOCAL_CS["x",UNIT["metre",1]]', Affine(1, 0, 0, 0, -1, 0), "float32", "not supported"),
    "no inverse": ("EPSG:32632", Affine(0, 0, 500000, 0, 0, 5000000), "float32", "not supported"),
    "elsewhere": ("EPSG:32632", Affine(1e30, 0, 5e300, 0, -1e30, 5e300), "float32", "not supported"),
    "complex": ("EPSG:32632", Affine(10, 0, 500000, 0, -10, 5000000), "complex64", "complex numbers"),
}


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize("trouble", ROOMLESS)
def test_a_geotiff_that_gdal_cannot_warp_is_one_line(tmp_path, trouble):
    crs, transform, kind, word = ROOMLESS[trouble]
    path = tmp_path / "t.tif"
    shape = {"width": 8, "height": 8, "count": 1}
    with rasterio.open(path, "w", driver="GTiff", **shape, dtype=kind, crs=crs, transform=transform) as file:
        file.write(np.ones((1, 8, 8), kind))
    with pytest.raises(InputFileError, match=word) as refusal:
        read_elevation([path])
    assert len(str(refusal.value).splitlines()) == 1
