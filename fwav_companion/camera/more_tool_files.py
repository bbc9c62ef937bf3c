"""The calibration files of mrcal and gyroflow, and refusals of other projections with their tools' own conversions."""

from __future__ import annotations

from typing import Final

from fwav_companion.camera.fields import Fields
from fwav_companion.camera.tool_files import CameraMatrix, camera_matrix, distorted_lens, require_inside
from fwav_companion.types import Lens

MRCAL_MODELS: Final = {
    "LENSMODEL_PINHOLE": "none",
    "LENSMODEL_OPENCV4": "plumb_bob",
    "LENSMODEL_OPENCV5": "plumb_bob",
    "LENSMODEL_OPENCV8": "rational_polynomial",
}
"""mrcal's models that are OpenCV's, with their numbers in OpenCV's order."""
MRCAL_COUNTS: Final = {"LENSMODEL_PINHOLE": 4, "LENSMODEL_OPENCV4": 8, "LENSMODEL_OPENCV5": 9, "LENSMODEL_OPENCV8": 12}


def mrcal_lens(fields: Fields) -> Lens:
    """The lens of a .cameramodel: intrinsics fx, fy, cx, cy, then OpenCV's coefficients."""
    model = fields.text("lensmodel")
    if model not in MRCAL_MODELS:
        raise fields.refusal(
            "lensmodel",
            f"{', '.join(MRCAL_MODELS)}; convert: {_conversion(fields)}",
        )
    fx, fy, cx, cy, *d = fields.numbers("intrinsics", MRCAL_COUNTS[model])
    size = fields.size("imagersize")
    if min(fx, fy) <= 0.0:
        raise fields.refusal("intrinsics", "[fx, fy, cx, cy, ...] with positive fx and fy")
    require_inside(fields, "intrinsics", (cx, cy), size)
    matrix = CameraMatrix((fx, fy), (cx, cy), size)
    return distorted_lens(fields, MRCAL_MODELS[model], keys=("lensmodel", "intrinsics"), d=tuple(d), matrix=matrix)


def _conversion(fields: Fields) -> str:
    """The command that converts a .cameramodel; one without the calibration's inputs is fitted at sampled pixels.

    Of sampled pixels mrcal leaves out the corners, unless the radius is 0.
    """
    sampled = "" if "optimization_inputs" in fields else "--sampled --radius 0 "
    return f"mrcal-convert-lensmodel {sampled}LENSMODEL_OPENCV8 in.cameramodel > out.cameramodel"


def gyroflow_lens(fields: Fields) -> Lens:
    """The lens of a gyroflow lens profile: OpenCV's fisheye at the size of its calibration."""
    if "distortion_model" in fields and fields.text("distortion_model") not in ("", "opencv_fisheye"):
        raise fields.refusal("distortion_model", "opencv_fisheye")
    for key in ("input_horizontal_stretch", "input_vertical_stretch"):
        if key in fields and fields.number(key) not in (0.0, 1.0):
            raise fields.refusal(key, "1: a profile without a stretched picture")
    dimension, lens = fields.below("calib_dimension"), fields.below("fisheye_params")
    size = (dimension.whole_pixels("w"), dimension.whole_pixels("h"))
    matrix = camera_matrix(lens, "camera_matrix", size)
    d = lens.numbers("distortion_coeffs", 4)
    return distorted_lens(lens, "fisheye", keys=("distortion_model", "distortion_coeffs"), d=d, matrix=matrix)
