"""Pictures of a marked ground from several sides, drawn by inverse projection, with the tags of a DJI RTK drone."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
import pymap3d
from PIL import Image

from sitl_mock.maker_tags import LAYOUTS, TruePicture, tagged_jpeg
from tests.support.maker_pictures import ned_from_camera, pixel_of, true_picture

WIDTH, HEIGHT = 800, 600
FOCAL = 800 * 24 / 36
HOME = (47.0, 11.0)
MARKS = {"barrel": (6.0, -4.0), "car": (-9.0, 11.0)}
"""North and east of what stands on the ground, metres."""
COLOURS = {"barrel": (220, 60, 30), "car": (30, 70, 220)}


def mark_place(name: str) -> tuple[float, float]:
    """Latitude and longitude of a mark."""
    north, east = MARKS[name]
    lat, lon, _ = pymap3d.ned2geodetic(north, east, 0.0, *HOME, 0.0)
    return float(lat), float(lon)


def poses(count: int = 4) -> list[TruePicture]:
    """Cameras on a circle about the marks that look at its middle."""
    made = []
    for number in range(count):
        bearing = 2 * np.pi * number / count
        lat, lon, _ = pymap3d.ned2geodetic(-35 * np.cos(bearing), -35 * np.sin(bearing), 0.0, *HOME, 0.0)
        made.append(
            true_picture(
                np.random.default_rng(number), lat=float(lat), lon=float(lon), alt_amsl=440.0, above_takeoff=40.0,
                roll=0.0, pitch=-49.0, yaw=(np.degrees(bearing) + 180) % 360 - 180, width=WIDTH, height=HEIGHT,
                focal_px=FOCAL,
            )
        )  # fmt: skip
    return made


def drawn(picture: TruePicture) -> Image.Image:
    """The ground as the camera sees it: a board of 5 m squares with the marks."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    camera = np.stack([u - (WIDTH - 1) / 2, v - (HEIGHT - 1) / 2, np.full(u.shape, FOCAL)], axis=-1)
    ray = camera @ ned_from_camera(picture).T
    start_n, start_e, _ = pymap3d.geodetic2ned(picture.lat, picture.lon, 0.0, *HOME, 0.0)
    with np.errstate(divide="ignore"):
        north = start_n + ray[..., 0] * picture.above_takeoff / ray[..., 2]
        east = start_e + ray[..., 1] * picture.above_takeoff / ray[..., 2]
    dark = (np.floor(north / 5) + np.floor(east / 5)) % 2
    pixels = np.stack([90 + 20 * dark, 125 + 20 * dark, 70 + 15 * dark], axis=-1)
    for name, (at_n, at_e) in MARKS.items():
        pixels[np.hypot(north - at_n, east - at_e) < 0.8] = COLOURS[name]
    return Image.fromarray(pixels.astype(np.uint8))


def write_set(folder: Path, count: int = 4) -> list[tuple[Path, dict[str, tuple[float, float]]]]:
    """The pictures, and where the marks are in each: exact pixels."""
    written = []
    for number, picture in enumerate(poses(count)):
        out = BytesIO()
        drawn(picture).save(out, "JPEG", quality=80)
        xmp, exif = LAYOUTS["dji_rtk"](picture)
        path = folder / f"DJI_{number:04d}.JPG"
        path.write_bytes(tagged_jpeg(out.getvalue(), xmp, exif, (WIDTH, HEIGHT)))
        pixels = {name: pixel_of(picture, *mark_place(name), 400.0) for name in MARKS}
        written.append((path, pixels))
    return written
