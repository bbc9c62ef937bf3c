"""Pictures of every maker's layout with a known pose, and where a place on the map is in them.

The geometry is pymap3d's and scipy's: an oracle that shares nothing with the package.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
import pymap3d
from PIL import Image
from scipy.spatial.transform import Rotation

from sitl_mock.maker_tags import LAYOUTS, TruePicture, tagged_jpeg

WIDTH, HEIGHT, FOCAL = 4000, 3000, 4000 * 24 / 36
"""24 mm equivalent, exactly."""
FORWARD_CAMERA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Gimbal axes (forward, right, down) of the camera axes (right, down, forward)."""


def small_jpeg() -> bytes:
    """A picture of 40 x 30 pixels that stands for a large one."""
    out = BytesIO()
    Image.new("RGB", (40, 30), (90, 120, 60)).save(out, "JPEG")
    return out.getvalue()


def true_picture(rng: np.random.Generator, **given: float) -> TruePicture:
    """A pose 40 to 120 m above level ground at 400 m, at tilts of 25 degrees below the horizon to straight down."""
    from fwav_companion.geoid import egm96  # the grid has its own test against NGA's values

    lat, lon = float(rng.uniform(-60, 60)), float(rng.uniform(-179, 179))
    height = float(rng.uniform(40, 120))
    values = {
        "lat": lat, "lon": lon, "alt_amsl": 400.0 + height,
        "above_takeoff": height, "roll": float(rng.normal(0, 2)), "pitch": float(rng.uniform(-88, -40)),
        "yaw": float(rng.uniform(-180, 180)), "width": WIDTH, "height": HEIGHT, "focal_px": FOCAL,
    } | given  # fmt: skip
    undulation = egm96().undulation_m(values["lat"], values["lon"])
    return TruePicture(**values, undulation=undulation)  # type: ignore[arg-type]


def ned_from_camera(picture: TruePicture) -> np.ndarray:
    """The rotation from camera axes to north, east, down."""
    angles = [picture.yaw, picture.pitch, picture.roll]
    return Rotation.from_euler("ZYX", angles, degrees=True).as_matrix() @ FORWARD_CAMERA


def pixel_of(picture: TruePicture, lat: float, lon: float, alt_amsl: float) -> tuple[float, float]:
    """The pixel of a place in a picture."""
    hae = alt_amsl + picture.undulation
    ned = np.array(pymap3d.geodetic2ned(lat, lon, hae, picture.lat, picture.lon, picture.ellipsoid))
    x, y, z = ned_from_camera(picture).T @ ned
    if z <= 0:
        return (float("nan"), float("nan"))
    return (picture.focal_px * x / z + (picture.width - 1) / 2, picture.focal_px * y / z + (picture.height - 1) / 2)


def place_below(picture: TruePicture, u: float, v: float, above_takeoff: float = 0.0) -> tuple[float, float, float]:
    """Latitude, longitude and altitude where the ray of a pixel is at a height above the take-off."""
    camera = np.array([(u - (picture.width - 1) / 2), (v - (picture.height - 1) / 2), picture.focal_px])
    ray = ned_from_camera(picture) @ camera
    drop = picture.above_takeoff - above_takeoff
    north, east, down = ray * drop / ray[2]
    lat, lon, _ = pymap3d.ned2geodetic(north, east, down, picture.lat, picture.lon, picture.ellipsoid)
    return float(lat), float(lon), picture.alt_amsl - drop


def write_picture(path: Path, layout: str, picture: TruePicture, **tags: object) -> Path:
    """A small JPEG with the tags that this maker writes; ``tags``: more EXIF by number, as ``t274=6``."""
    xmp, exif = LAYOUTS[layout](picture)
    exif = exif | {int(name[1:]): value for name, value in tags.items()}
    path.write_bytes(tagged_jpeg(small_jpeg(), xmp, exif, (picture.width, picture.height)))
    return path
