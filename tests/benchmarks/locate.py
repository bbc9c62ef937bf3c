"""From the command to the place of a pixel in a picture of 12 Mpx, and the poses of a thousand pictures.

``python -m tests.benchmarks.locate``
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from io import BytesIO
from pathlib import Path
from statistics import median

import numpy as np
from PIL import Image

from fwav_companion.photographs.files import read_tags
from fwav_companion.photographs.pose_from_tags import pose_from_tags
from sitl_mock.maker_tags import TruePicture, dji_rtk, tagged_jpeg
from tests.benchmarks.figure import Figure, interleaved
from tests.benchmarks.startup import compiled

ROUNDS = 7
PICTURES = 1000
EXIF_IFD, GPS_IFD = 0x8769, 0x8825
WIDTH, HEIGHT = 4000, 3000
TERRAIN_POSTS = 1201


def _picture(path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 255, (HEIGHT // 4, WIDTH // 4, 3), dtype=np.uint8)
    out = BytesIO()
    Image.fromarray(pixels).resize((WIDTH, HEIGHT)).save(out, "JPEG", quality=80)
    truth = TruePicture(47.5, 11.5, 580.0, 48.0, 80.0, 0.0, -60.0, 30.0, WIDTH, HEIGHT, 2666.7)
    path.write_bytes(tagged_jpeg(out.getvalue(), *dji_rtk(truth), (WIDTH, HEIGHT)))


def _cpu_s(*command: str) -> float:
    process = subprocess.Popen(
        [sys.executable, *command], env=compiled(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise RuntimeError(f"{command} ended with {process.returncode}")
    return used.ru_utime + used.ru_stime


def _pillow(path: Path) -> None:
    """All that Pillow itself reads of a picture's tags."""
    with Image.open(path) as image:
        exif = image.getexif()
        dict(exif), dict(exif.get_ifd(EXIF_IFD)), dict(exif.get_ifd(GPS_IFD)), image.info.get("xmp")


def measure() -> list[Figure]:
    """CPU in alternating rounds; the first, which compiles files, does not count."""
    with tempfile.TemporaryDirectory() as name:
        path, terrain = Path(name) / "a.jpg", Path(name) / "N47E011.hgt"
        _picture(path)
        terrain.write_bytes(np.full((TERRAIN_POSTS, TERRAIN_POSTS), 500, ">i2").tobytes())
        command = ("-m", "fwav_companion", "locate", str(path), "--pixel", "1912,1034")
        rounds = [
            (_cpu_s("-c", "import numpy"), _cpu_s(*command), _cpu_s(*command, "--terrain", str(terrain)))
            for _ in range(ROUNDS + 1)
        ]
        bare_s, flat_s, terrain_s = (median(each) for each in zip(*rounds[1:], strict=True))
        many = [path] * PICTURES
        ours_s, pillow_s = interleaved(
            lambda: [pose_from_tags(read_tags(each)) for each in many],
            lambda: [_pillow(each) for each in many],
            rounds=5,
        )
    detail = f"python -c 'import numpy' {bare_s * 1e3:.0f} ms of CPU"
    return [
        Figure("locate in a picture of 12 Mpx, against a start with numpy", flat_s / bare_s, 6.0, False,
               f"{flat_s * 1e3:.0f} ms, {detail}"),
        Figure("locate with terrain, against a start with numpy", terrain_s / bare_s, 8.0, False,
               f"{terrain_s * 1e3:.0f} ms, {detail}"),
        Figure("poses of 1000 pictures, against Pillow's reading of their tags", ours_s / pillow_s, 3.0, False,
               f"{ours_s * 1e3:.0f} ms, Pillow {pillow_s * 1e3:.0f} ms of CPU"),
    ]  # fmt: skip


if __name__ == "__main__":
    print(*measure(), sep="\n")
