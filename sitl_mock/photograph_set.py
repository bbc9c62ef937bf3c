"""Photographs of a field with AprilTags, as a drone with RTK takes them: rendered by the true poses, tagged by the
poses that the drone believes.

The ground is flat, so that the map from ground to picture is a homography.
"""

from __future__ import annotations

import json
import sys
from math import cos, pi, radians, sin, sqrt
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import cv2
import numpy as np

from sitl_mock.earth import Place, World
from sitl_mock.maker_tags import TruePicture, dji_rtk, tagged_jpeg
from sitl_mock.rotation import matrix_from_euler

HOME = Place(46.874319, 102.448729, 1450.0)
"""The take-off: a place of NGA's test values of EGM96."""
UNDULATION_M = -43.575
WIDTH, HEIGHT, FOCAL_PX = 1600, 1200, 1150.0
ABOVE_M, AWAY_M = 38.0, 30.0
SIDE_M = 2.0
"""Side of a tag's black square, metres."""
MODULES = 8
FIELD_M, PER_M = 90.0, 20
"""Side of the field, metres, and pixels of its picture in a metre."""
OWN_POSITION_M, SHARED_POSITION_M, OWN_TURN_DEG, MOUNT_DEG, HEADING_DEG = 0.02, 0.03, 0.2, 0.3, 0.7
"""One sigma of what is drawn: each picture's position and rotation, then the same in all pictures."""
OWN_HEIGHT_M, SHARED_HEIGHT_M = 0.5, 1.5
"""Of the height above the take-off, by a barometer."""
DARK, LIGHT = (58, 92, 60), (74, 112, 78)
"""Grass, blue, green, red."""


class GroundMark(NamedTuple):
    """A tag on the ground."""

    tag_id: int
    north: float
    east: float
    place: Place


class PhotographSet(NamedTuple):
    """The pictures of a folder and what they show."""

    pictures: list[Path]
    marks: list[GroundMark]


def write_photographs(folder: Path, seed: int, count: int = 6) -> PhotographSet:
    """Write the pictures into an existing folder."""
    random, world = Random(seed), World(HOME)
    marks = []
    for tag_id, (north, east) in enumerate(((-14.0, -9.0), (9.0, -12.0), (12.0, 13.0), (-8.0, 11.0), (1.0, 0.0))):
        at = (north + random.uniform(-3, 3), east + random.uniform(-3, 3))
        marks.append(GroundMark(tag_id, *at, world.place((*at, 0.0))))
    field = _field(marks, random)
    shared = [random.gauss(0, SHARED_POSITION_M), random.gauss(0, SHARED_POSITION_M), random.gauss(0, SHARED_HEIGHT_M)]
    mount = [random.gauss(0, radians(MOUNT_DEG)) for _ in range(3)]
    heading = random.gauss(0, HEADING_DEG)
    written = []
    for number in range(count):
        bearing = 2.0 * pi * number / count + random.uniform(-0.2, 0.2)
        place = (-AWAY_M * cos(bearing), -AWAY_M * sin(bearing), -ABOVE_M - random.uniform(0, 4))
        turn = matrix_from_euler(0.0, radians(random.uniform(-56, -48)), bearing + random.gauss(0, 0.05))
        image = _picture(field, place, turn, random)
        own = [random.gauss(0, radians(OWN_TURN_DEG)) for _ in range(3)]
        believed = [place[i] + shared[i] * (-1 if i == 2 else 1) for i in range(3)]
        believed = [believed[0] + random.gauss(0, OWN_POSITION_M), believed[1] + random.gauss(0, OWN_POSITION_M),
                    believed[2] + random.gauss(0, OWN_HEIGHT_M)]  # fmt: skip
        truth = _tags(world, believed, place[2], turn, [a + b for a, b in zip(own, mount, strict=True)], heading)
        xmp, exif = dji_rtk(truth)
        path = folder / f"DJI_{number + 1:04d}.JPG"
        path.write_bytes(tagged_jpeg(image, xmp, exif, (WIDTH, HEIGHT)))
        written.append(path)
    return PhotographSet(written, marks)


def _tags(
    world: World, place: list[float], true_down: float, turn: Any, small: list[float], heading_deg: float
) -> TruePicture:
    """What the drone writes: RTK's altitude, the barometer's height, and turned angles."""
    at = world.place((place[0], place[1], 0.0))
    x, y, z = small
    error = np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])
    r = np.array(turn) @ error
    return TruePicture(
        lat=at.lat, lon=at.lon, alt_amsl=HOME.alt_amsl - true_down, undulation=UNDULATION_M,
        above_takeoff=-place[2], roll=float(np.degrees(np.arctan2(r[2, 1], r[2, 2]))),
        pitch=float(np.degrees(np.arcsin(-r[2, 0] / sqrt(float(r[0, 0] ** 2 + r[1, 0] ** 2 + r[2, 0] ** 2))))),
        yaw=float(np.degrees(np.arctan2(r[1, 0], r[0, 0]))) + heading_deg, width=WIDTH, height=HEIGHT,
        focal_px=FOCAL_PX,
    )  # fmt: skip


def _field(marks: list[GroundMark], random: Random) -> Any:
    """The ground from above, north up."""
    side = int(FIELD_M * PER_M)
    noise = np.random.default_rng(random.randrange(1 << 30)).normal(0, 7, (side // 4, side // 4, 1)).repeat(3, axis=2)
    field = np.clip(np.array(DARK) + noise, 0, 255).astype(np.uint8)
    field = np.asarray(cv2.resize(field, (side, side)))
    for line in range(0, side, 10 * PER_M):
        field[line : line + 2 * PER_M] = np.clip(field[line : line + 2 * PER_M].astype(int) + 14, 0, 255)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    for mark in marks:
        module = round(SIDE_M * PER_M / MODULES)
        tag = cv2.aruco.generateImageMarker(dictionary, mark.tag_id, module * MODULES)
        tag = np.pad(tag, module, constant_values=255)
        row, column = (round(v) for v in _field_pixel(mark.north, mark.east))
        half = tag.shape[0] // 2
        field[row - half : row + half, column - half : column + half] = tag[..., None]
    return field


def _field_pixel(north: float, east: float) -> tuple[float, float]:
    return (FIELD_M / 2 - north) * PER_M, (FIELD_M / 2 + east) * PER_M


def _picture(field: Any, place: tuple[float, float, float], turn: Any, random: Random) -> bytes:
    """The JPEG that a pinhole camera takes."""
    r = np.array(turn)
    camera = np.array([r[:, 1], r[:, 2], r[:, 0]])  # right, down, forward, in NED
    k = np.array([[FOCAL_PX, 0, (WIDTH - 1) / 2], [0, FOCAL_PX, (HEIGHT - 1) / 2], [0, 0, 1.0]])
    from_ground = k @ camera @ np.array([[1, 0, -place[0]], [0, 1, -place[1]], [0, 0, -place[2]]])
    ground_from_field = np.array([[0, -1 / PER_M, FIELD_M / 2], [1 / PER_M, 0, -FIELD_M / 2], [0, 0, 1.0]])
    image = cv2.warpPerspective(
        field, from_ground @ ground_from_field, (WIDTH, HEIGHT), flags=cv2.INTER_AREA, borderValue=LIGHT
    )
    image = cv2.GaussianBlur(image, (0, 0), 0.7)
    noise = np.random.default_rng(random.randrange(1 << 30)).normal(0, 2.0, image.shape)
    good, jpeg = cv2.imencode(".jpg", np.clip(image + noise, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 88])
    if not good:
        raise RuntimeError("the picture cannot be encoded")
    return bytes(jpeg.tobytes())


def main() -> None:
    """Write pictures and truth.json into a folder: ``python -m sitl_mock.photograph_set FOLDER SEED``."""
    folder = Path(sys.argv[1])
    made = write_photographs(folder, int(sys.argv[2]))
    truth = {
        "pictures": [path.name for path in made.pictures],
        "tags": [{"id": mark.tag_id, "lat": mark.place.lat, "lon": mark.place.lon} for mark in made.marks],
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
