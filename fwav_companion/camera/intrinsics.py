"""From a camera matrix, a model's name and its coefficients to a lens, by the exact maps between the tools.

OpenCV's fisheye, Kalibr's and ROS's equidistant and camodocal's KANNALA_BRANDT are one model with k1 = 1: the focal
lengths take the place of pixels per millimetre, and their four coefficients are the paper's k2 to k5 over its k1.
"""

from __future__ import annotations

import msgspec

from fwav_companion.camera.brown_conrady import BrownConrady
from fwav_companion.camera.fields import Fields
from fwav_companion.camera.kannala_brandt import KannalaBrandt
from fwav_companion.types import Lens

FISHEYE_NAMES = ("equidistant", "fisheye")
PINHOLE_COUNTS = {"plumb_bob": (4, 5), "rational_polynomial": (8,), "radtan": (4,), "none": (0,)}
"""Coefficients by model name: Kalibr's radtan is a plumb_bob of four."""


class CameraMatrix(msgspec.Struct, frozen=True):
    """What every tool tells, in pixels."""

    focal: tuple[float, float]
    principal_point: tuple[float, float]
    image_size: tuple[int, int]
    skew: float = 0.0
    """K[0][1] / K[0][0]."""


def camera_matrix(fields: Fields, key: str, image_size: tuple[int, int]) -> CameraMatrix:
    """From nine numbers, row by row."""
    fx, fxy, cx, zero, fy, cy, *last = fields.numbers(key, 9)
    if fx <= 0.0 or fy <= 0.0 or zero or last != [0.0, 0.0, 1.0]:
        raise fields.refusal(key, "[fx, skew, cx, 0, fy, cy, 0, 0, 1] with positive fx and fy")
    return checked(fields, key, CameraMatrix((fx, fy), (cx, cy), image_size, fxy / fx))


def checked(fields: Fields, key: str, matrix: CameraMatrix) -> CameraMatrix:
    """Refuses a principal point outside the image: it is then of another image, or in other units."""
    (u, v), (width, height) = matrix.principal_point, matrix.image_size
    if not (-0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5):
        raise fields.refusal(key, f"a principal point inside the image of {width} x {height} pixels")
    return matrix


def distorted_lens(fields: Fields, model_key: str, coefficients_key: str, matrix: CameraMatrix) -> Lens:
    """The lens of the model that ``model_key`` names, with the numbers under ``coefficients_key``."""
    model = fields.text(model_key).lower()
    if model in FISHEYE_NAMES:
        d = fields.numbers(coefficients_key, 4)
        return KannalaBrandt((1.0, *d), matrix.focal, matrix.principal_point, matrix.image_size, skew=matrix.skew)
    if model in PINHOLE_COUNTS:
        d = fields.numbers(coefficients_key, *PINHOLE_COUNTS[model])
        d = (*d, *(0.0,) * (4 - len(d)))
        return BrownConrady(matrix.focal, matrix.principal_point, d, matrix.image_size, skew=matrix.skew)
    raise fields.refusal(model_key, ", ".join((*FISHEYE_NAMES, *PINHOLE_COUNTS)))
