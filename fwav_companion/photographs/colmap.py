"""COLMAP's text model: images.txt and cameras.txt, brought to the map by the pictures' own positions. PURE.

COLMAP's world has no place, no north and no scale. A similarity (Umeyama 1991) of its camera centres to the positions
in the pictures' tags gives all three; it needs three pictures that do not lie on one line.

Source of the format: COLMAP's documentation, "Output Format": world to camera as a quaternion (w, x, y, z) and a
translation, camera x right, y down, z forward; the centre of the top left pixel is (0.5, 0.5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees, isfinite, sqrt
from typing import Final

import msgspec
import numpy as np

from fwav_companion.errors import InputFileError
from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.mounts import euler_from_body_from_camera
from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.vectors import Matrix3, Vector3, scale, transform, transpose
from fwav_companion.photographs.lens_from_tags import CALIBRATED_SIGMA
from fwav_companion.photographs.makers import ADJUSTED
from fwav_companion.photographs.picture_pose import Altitude, NoPose, PictureLens, PicturePose, Sigma

IMAGE_FIELDS: Final = 10
LEAST_PICTURES: Final = 3
MOST_TILT_DEG: Final = 3.0
"""Largest sigma of the aligned world's rotation; pictures near one line do not show it."""
PARAMETERS: Final = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
}


class ColmapImage(msgspec.Struct, frozen=True):
    """One image in COLMAP's world."""

    file: str
    centre: Vector3
    world_from_camera: Matrix3
    camera: str
    """Id of its camera."""


class ColmapModel(msgspec.Struct, frozen=True):
    """The images of a model, and the lenses of the cameras whose model is known."""

    images: tuple[ColmapImage, ...]
    lenses: Mapping[str, PictureLens]

    def lens_by_file(self) -> dict[str, PictureLens]:
        """The lens of each picture whose camera's model is known."""
        return {each.file: self.lenses[each.camera] for each in self.images if each.camera in self.lenses}


def parse_colmap(images: str, cameras: str, name: str) -> ColmapModel:
    """The model. ``cameras``: content of cameras.txt, or "". InputFileError names the line."""
    found, lines, number = [], images.removeprefix("\ufeff").splitlines(), 0
    while number < len(lines):
        line = lines[number].strip()
        number += 1
        if not line or line.startswith("#"):
            continue
        found.append(_image(line, f"{name}: line {number}"))
        number += 1  # the line of its points, which may be empty
    if not found:
        raise InputFileError(f"{name}: no image in it; accepted: COLMAP's images.txt")
    return ColmapModel(tuple(found), _lenses(cameras))


def aligned_poses(
    model: ColmapModel, tagged: Mapping[str, PicturePose | NoPose], name: str
) -> dict[str, PicturePose | NoPose]:
    """Poses of all images, on the altitude scale of the pictures' tags.

    ``tagged``: poses, or places, by the pictures' own tags. InputFileError says what an alignment needs.
    """
    known = [(image, place) for image in model.images if (place := _place(tagged.get(image.file))) is not None]
    heights = _heights([place for _, place in known])
    if len(known) < LEAST_PICTURES or heights is None:
        raise InputFileError(
            f"{name}: COLMAP's world has no place on the map, and {len(known)} of its {len(model.images)} images are "
            "pictures with position and altitude in their tags; accepted: at least 3 such pictures among those given"
        )
    first = known[0][1]
    plane = TangentPlane(Geodetic.from_degrees(first.lat_deg, first.lon_deg, heights[0].metres))
    truth = np.array(
        [
            plane.ned_from_geodetic(Geodetic.from_degrees(place.lat_deg, place.lon_deg, height.metres))
            for (_, place), height in zip(known, heights, strict=True)
        ]
    )
    factor, turn, shift, rms_m, tilt_deg = _similarity(np.array([image.centre for image, _ in known]), truth)
    if not tilt_deg < MOST_TILT_DEG:
        raise InputFileError(
            f"{name}: the pictures' positions lie too near one line, or do not fit the model ({rms_m:.1f} m rms): its "
            f"rotation is known within {tilt_deg:.0f} degrees; accepted: pictures from several lines of flight"
        )
    note = f"COLMAP's world aligned to the positions of {len(known)} pictures, within {rms_m:.1f} m (rms)"
    poses: dict[str, PicturePose | NoPose] = {}
    for image in model.images:
        ned = factor * turn @ np.array(image.centre) + shift
        rows = [tuple(float(x) for x in row) for row in turn @ np.array(image.world_from_camera)]
        ned_from_camera: Matrix3 = ((*rows[0],), (*rows[1],), (*rows[2],))  # type: ignore[assignment]
        at = plane.geodetic_from_ned((float(ned[0]), float(ned[1]), float(ned[2])))
        roll, pitch, yaw = map(degrees, euler_from_body_from_camera(ned_from_camera))
        height = Altitude(at.alt_amsl_m, heights[0].datum, _shared(heights, rms_m, len(known)), heights[0].note)
        by_takeoff = known[0][1].above_takeoff is heights[0]
        poses[image.file] = PicturePose(
            lat_deg=at.lat_deg,
            lon_deg=at.lon_deg,
            roll_deg=roll,
            pitch_deg=pitch,
            yaw_deg=yaw,
            absolute=None if by_takeoff else height,
            above_takeoff=height if by_takeoff else None,
            sigmas=msgspec.structs.replace(
                ADJUSTED,
                position_m=Sigma(0.1, max(first.sigmas.position_m.shared, rms_m / sqrt(len(known)))),
                attitude_deg=Sigma(ADJUSTED.attitude_deg.own, max(ADJUSTED.attitude_deg.shared, tilt_deg)),
                heading_deg=max(ADJUSTED.heading_deg, tilt_deg),
            ),
            layout="COLMAP",
            notes=(note,),
        )
    return poses


def _shared(heights: Sequence[Altitude], rms_m: float, count: int) -> Sigma:
    return Sigma(0.1, max(heights[0].sigma.shared, rms_m / sqrt(count)))


def _place(tagged: PicturePose | NoPose | None) -> PicturePose | None:
    return tagged.place if isinstance(tagged, NoPose) else tagged


def _heights(places: Sequence[PicturePose]) -> list[Altitude] | None:
    """One altitude of each picture on one scale: the better of absolute and above the take-off, where all have it."""
    absolute = [place.absolute for place in places if place.absolute is not None]
    relative = [place.above_takeoff for place in places if place.above_takeoff is not None]
    one_datum = len({each.datum for each in absolute}) == 1
    choices = [each for each in (absolute if one_datum else [], relative) if len(each) == len(places) and each]
    return min(choices, key=lambda each: each[0].sigma.shared) if choices else None


def _similarity(model: np.ndarray, truth: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, float, float]:
    """(scale, rotation, shift, rms in metres, sigma of the rotation in degrees) from the model's world to NED."""
    middle, target = model.mean(axis=0), truth.mean(axis=0)
    a, b = model - middle, truth - target  # (N, 3)
    u, values, vt = np.linalg.svd(b.T @ a)
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt)) or 1.0])
    turn = u @ sign @ vt
    spread = float(np.sum(a * a))
    factor = float(np.trace(np.diag(values) @ sign) / spread) if spread > 0.0 else 0.0
    shift = target - factor * turn @ middle
    residuals = b - factor * a @ turn.T
    freedom = max(1, 3 * len(model) - 7)
    rms_m = float(sqrt(np.sum(residuals**2) / freedom))
    second = float(np.linalg.svd(b, compute_uv=False)[1])  # root of the sum of squares across the longest direction
    tilt_deg = degrees(max(rms_m, 0.01) / second) if second > 0.0 else 180.0
    return factor, turn, shift, rms_m, min(180.0, tilt_deg)


def _image(line: str, where: str) -> ColmapImage:
    parts = line.split(maxsplit=IMAGE_FIELDS - 1)
    try:
        w, x, y, z, *shift = (float(each) for each in parts[1:8])
        norm = sqrt(w * w + x * x + y * y + z * z)
        rotation = matrix_from_quaternion((w / norm, x / norm, y / norm, z / norm))
        file, camera = parts[9], parts[8]
    except (ValueError, IndexError, ZeroDivisionError):
        raise InputFileError(
            f"{where}: {line[:60]!r}; accepted: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
        ) from None
    if not all(map(isfinite, (w, x, y, z, *shift))):
        raise InputFileError(f"{where}: {line[:60]!r} is not finite; accepted: COLMAP's images.txt")
    back = transpose(rotation)
    centre = scale(transform(back, (shift[0], shift[1], shift[2])), -1.0)
    return ColmapImage(file.replace("\\", "/").rpartition("/")[2], centre, back, camera)


def _lenses(text: str) -> dict[str, PictureLens]:
    """The lenses of cameras.txt by their ids; those of other models, and lines that are none, are left out."""
    found = {}
    for line in text.splitlines():
        parts = line.split()
        names = PARAMETERS.get(parts[1], ()) if len(parts) > 4 and not line.startswith("#") else ()
        try:
            values = dict(zip(names, map(float, parts[4:]), strict=True))
            size = (int(parts[2]), int(parts[3]))
        except (ValueError, IndexError):
            continue
        if not values or not all(map(isfinite, values.values())) or min(size) < 1:
            continue
        focal = (values.get("fx", values.get("f", 0.0)), values.get("fy", values.get("f", 0.0)))
        if min(focal) <= 0.0:
            continue
        distortion = (*(values.get(each, 0.0) for each in ("k1", "k2", "p1", "p2")), 0.0)
        found[parts[0]] = PictureLens(
            focal_px=focal,
            principal_point=(values["cx"] - 0.5, values["cy"] - 0.5),
            distortion=distortion if any(distortion) else (),
            size=size,
            focal_sigma=CALIBRATED_SIGMA,
            source="COLMAP's cameras.txt",
        )
    return found
