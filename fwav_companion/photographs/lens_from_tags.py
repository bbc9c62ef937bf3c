"""The lens of a picture by its best tag: DewarpData, CalibratedFocalLength, a thermal table, 35 mm equivalent."""

from __future__ import annotations

from typing import Final

import msgspec

from fwav_companion.photographs.exif_tags import FOCAL_35MM, FOCAL_MM, MODEL, text_of
from fwav_companion.photographs.picture_pose import NoLens, PictureLens
from fwav_companion.photographs.tags import PictureTags, finite_number

CALIBRATED_SIGMA: Final = 0.003
"""Of the maker's own calibration of this camera (DewarpData)."""
NOMINAL_SIGMA: Final = 0.01
"""Of CalibratedFocalLength, which is the design's."""
EQUIVALENT_SIGMA: Final = 0.04
"""Of a 35 mm equivalent: -6.7 to +3.5 % against calibrated lenses."""
THERMAL_SIGMA: Final = 0.03
FILM_WIDTH_MM: Final = 36.0
LEAST_FOCAL, LARGEST_FOCAL = 0.2, 100.0
"""Focal length over image width: 136 degrees of view to 0.6 degrees."""
DEWARP_NUMBERS: Final = 9


class ThermalLens(msgspec.Struct, frozen=True):
    """Lens of a thermal camera, whose pictures bear the make and model of the drone or of its visible camera."""

    models: tuple[str, ...]
    """Parts of EXIF Model, lower case."""
    size: tuple[int, int]
    pitch_um: float
    """Of the sensor's pixels."""
    focal_mm: float | None
    """None: sold with several lenses; EXIF's focal length says which one."""


THERMAL: Final = (
    ThermalLens(("mavic2-enterprise-advanced", "m2ea"), (640, 512), 12.0, 9.12),
    ThermalLens(("xl715",), (640, 512), 12.0, 9.1),
    ThermalLens(("boson", "x10", "teal"), (640, 512), 12.0, 13.6),
    ThermalLens(("anafithermal", "anafiusa", "anafi thermal", "anafi usa"), (320, 256), 12.0, 4.3),
    ThermalLens(("x2e", "skydio x2"), (320, 256), 12.0, 9.1),
    ThermalLens(("xt2",), (640, 512), 17.0, None),
    ThermalLens(("xt2",), (336, 256), 17.0, None),
)
"""From OpenAthena's table of drone models (DroneModels); Zenmuse XT2, whose sensor is a FLIR Tau 2, from its
MetadataExtractor.java. For the XT S public tables differ (336 x 256 of 17 um, 640 x 512 of 12 um): it is asked for.
"""
UNKNOWN_THERMAL: Final = ("xt s", "xts")
"""Models whose thermal lens is not known, lower case."""
LARGEST_THERMAL_WIDTH: Final = 1280


def lens_from_tags(tags: PictureTags) -> PictureLens | NoLens:
    """The lens by the best tag that the picture has; NoLens asks for one."""
    width, height = tags.size
    found = _dewarp(tags) or _calibrated(tags) or _thermal(tags) or _equivalent(tags)
    if isinstance(found, NoLens):
        return found
    if found is None:
        return NoLens("no focal length in its tags; give --hfov DEG or --camera FILE")
    if not all(LEAST_FOCAL * width < focal < LARGEST_FOCAL * width for focal in found.focal_px):
        return NoLens(f"{found.source} gives a focal length of {found.focal_px[0]:.5g} px: not that of this picture")
    u, v = found.principal_point
    if not (-0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5):
        return NoLens(f"{found.source} has its centre outside the picture")
    return found


def lens_from_field_of_view(size: tuple[int, int], focal_px: float, sigma: float, source: str) -> PictureLens:
    """A pinhole with its axis in the middle of the picture."""
    middle = ((size[0] - 1) / 2.0, (size[1] - 1) / 2.0)
    return PictureLens(
        focal_px=(focal_px, focal_px),
        principal_point=middle,
        distortion=(),
        size=size,
        focal_sigma=sigma,
        source=source,
    )


def _dewarp(tags: PictureTags) -> PictureLens | None:
    """DJI: date;fx,fy,cx,cy,k1,k2,p1,p2,k3, where cx and cy are offsets from the picture's centre."""
    _, _, listed = tags.text("DewarpData").rpartition(";")
    numbers = [number for part in listed.split(",") if (number := finite_number(part)) is not None]
    if len(numbers) != DEWARP_NUMBERS or min(numbers[:2]) <= 0.0:
        return None
    fx, fy, cx, cy, *distortion = numbers
    corrected = tags.text("DewarpFlag") == "1"
    return PictureLens(
        focal_px=(fx, fy),
        principal_point=((tags.size[0] - 1) / 2.0 + cx, (tags.size[1] - 1) / 2.0 + cy),
        distortion=() if corrected else tuple(distortion),
        size=tags.size,
        focal_sigma=CALIBRATED_SIGMA,
        source="DewarpData",
        notes=("the picture was already corrected for distortion (DewarpFlag 1)",) if corrected else (),
    )


def _calibrated(tags: PictureTags) -> PictureLens | None:
    fx = tags.number("CalibratedFocalLength", "CalibratedFocalLengthX")
    fy = tags.number("CalibratedFocalLength", "CalibratedFocalLengthY")
    if fx is None or fy is None or min(fx, fy) <= 0.0:
        return None
    cx, cy = tags.number("CalibratedOpticalCenterX"), tags.number("CalibratedOpticalCenterY")
    centre = ((tags.size[0] - 1) / 2.0 if cx is None else cx, (tags.size[1] - 1) / 2.0 if cy is None else cy)
    return PictureLens(
        focal_px=(fx, fy),
        principal_point=centre,
        distortion=(),
        size=tags.size,
        focal_sigma=NOMINAL_SIGMA,
        source="CalibratedFocalLength",
    )


def _thermal(tags: PictureTags) -> PictureLens | NoLens | None:
    """The table's lens for a picture whose size is a thermal sensor's: the 35 mm equivalent is the other camera's.

    NoLens where neither table nor EXIF has this camera's focal length.
    """
    model = text_of(tags, MODEL)
    for lens in THERMAL:
        if tags.size == lens.size and any(part in model.lower() for part in lens.models):
            focal_mm = finite_number(tags.exif.get(FOCAL_MM)) if lens.focal_mm is None else lens.focal_mm
            if focal_mm is None or focal_mm <= 0.0:
                return NoLens(
                    f"{model}, a thermal camera with several lenses, and no focal length in EXIF; "
                    "give --hfov DEG or --camera FILE"
                )
            focal_px = 1e3 * focal_mm / lens.pitch_um
            return lens_from_field_of_view(tags.size, focal_px, THERMAL_SIGMA, "table of thermal cameras")
    if max(tags.size) <= LARGEST_THERMAL_WIDTH and any(part in model.lower() for part in UNKNOWN_THERMAL):
        return NoLens(f"{model}, a thermal camera whose lens is not known; give --hfov DEG or --camera FILE")
    return None


def _equivalent(tags: PictureTags) -> PictureLens | None:
    """35 mm equivalent by the width rule, within 1 % of calibrated lenses on 4:3 sensors (Skydio 2, Phantom 4 RTK)."""
    equivalent = finite_number(tags.exif.get(FOCAL_35MM))
    source = tags.text("ImageSource").lower()
    if equivalent is None or equivalent <= 0.0 or "infrared" in source or "thermal" in source:
        return None
    longer = max(tags.size)
    focal = longer * equivalent / FILM_WIDTH_MM
    return lens_from_field_of_view(tags.size, focal, EQUIVALENT_SIGMA, "35 mm equivalent focal length")
