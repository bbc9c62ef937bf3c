"""The calibration files of other tools: Kalibr, ROS, camodocal, OpenCV, by exact maps between their models.

OpenCV's fisheye, Kalibr's and ROS's equidistant and camodocal's KANNALA_BRANDT are one model with k1 = 1: the focal
lengths take the place of pixels per millimetre, and their four coefficients are the paper's k2 to k5 over its k1.
"""

from __future__ import annotations

import re

import msgspec

from fwav_companion.camera.brown_conrady import BrownConrady
from fwav_companion.camera.fields import Fields
from fwav_companion.camera.kannala_brandt import KannalaBrandt
from fwav_companion.camera.plausible_lens import require_field_of_view, require_monotonic, require_pinhole_terms
from fwav_companion.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix
from fwav_companion.geometry.vectors import IDENTITY3, Matrix3, multiply, transpose
from fwav_companion.types import Lens

OPENCV_MATRIX_KEYS = ("camera_matrix", "K", "cameraMatrix", "Camera_Matrix")
OPENCV_DISTORTION_KEYS = ("distortion_coefficients", "D", "distCoeffs", "dist_coeffs", "Distortion_Coefficients")
MODEL_KEYS = (
    "model",
    "camera_model",
    "distortion_model",
    "lens_model",
    "calibration_model",
    "fisheye_model",
    "fisheye",
)
"""Keys of the model's name; the last two are OpenCV's own sample's, 1 or 0."""
SIZE_KEYS = (("image_width", "image_height"), ("width", "height"), ("image_Width", "image_Height"))
FISHEYE_NAMES = ("equidistant", "fisheye")
PINHOLE_COUNTS = {"plumb_bob": (4, 5), "rational_polynomial": (8,), "radtan": (4,), "none": (0,)}
"""Number of coefficients by model name. Kalibr's radtan is a plumb_bob of four."""


class CameraMatrix(msgspec.Struct, frozen=True):
    """The linear part of a pinhole or fisheye model, which every tool's file contains."""

    focal: tuple[float, float]
    """Focal lengths along u and v, pixels (a radian, of a fisheye)."""
    principal_point: tuple[float, float]
    """Pixel of the optical axis."""
    image_size: tuple[int, int]
    """Width and height, pixels."""
    skew: float = 0.0
    """K[0][1] / K[0][0]."""


def kalibr_camera(fields: Fields, wanted: str) -> Fields:
    """The camera of a Kalibr camchain. ``wanted``: its key, as cam1; "" for the only one."""
    cameras = [key for key in fields if re.fullmatch(r"cam\d+", key)]
    if wanted and wanted not in cameras:
        raise fields.refusal(wanted, f"one of the file's cameras: {', '.join(cameras) or 'it has one without a name'}")
    if len(cameras) > 1 and not wanted:
        file = fields.name.rpartition("/")[2]
        raise fields.refusal(
            cameras[1], f'one camera: name it, as [camera] calibration = "{file}#{cameras[0]}", of {", ".join(cameras)}'
        )
    return fields.below(wanted or cameras[0]) if cameras else fields


def kalibr_lens(fields: Fields) -> Lens:
    """The lens of a Kalibr pinhole with its distortion model; omni, ds and eucm are read by ``sphere_files``."""
    if fields.text("camera_model") != "pinhole":
        raise fields.refusal("camera_model", "pinhole with distortion_model equidistant or radtan, omni, ds or eucm")
    fu, fv, pu, pv = fields.numbers("intrinsics", 4)
    if min(fu, fv) <= 0.0:
        raise fields.refusal("intrinsics", "[fu, fv, pu, pv] with positive fu and fv")
    size = fields.size("resolution")
    require_inside(fields, "intrinsics", (pu, pv), size)
    matrix = CameraMatrix((fu, fv), (pu, pv), size)
    return _distorted_lens(fields, "distortion_model", "distortion_coeffs", matrix)


def kalibr_time_offset_s(fields: Fields) -> float | None:
    """The delay of the stamps; Kalibr's t_imu = t_cam + shift has the opposite sign. None where the file has none."""
    return -fields.number("timeshift_cam_imu") if "timeshift_cam_imu" in fields else None


def kalibr_mount(fields: Fields) -> Matrix3:
    """The rotation body_from_camera of T_cam_imu, which maps IMU axes into the camera's; IMU axes are the body's."""
    t = fields.numbers("T_cam_imu", 16)
    camera_from_imu: Matrix3 = ((t[0], t[1], t[2]), (t[4], t[5], t[6]), (t[8], t[9], t[10]))
    product = multiply(camera_from_imu, transpose(camera_from_imu))
    wrong = max(abs(product[i][j] - IDENTITY3[i][j]) for i in range(3) for j in range(3))
    (a, b, c), (d, e, f), (g, h, i) = camera_from_imu
    if wrong > 1e-3 or a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0.0:
        raise fields.refusal("T_cam_imu", "a 4x4 matrix that begins with a rotation")
    return transpose(matrix_from_quaternion(quaternion_from_matrix(camera_from_imu)))


def ros_lens(fields: Fields) -> Lens:
    """The lens of a ROS camera_info, as a file or as a message. Its projection matrix is for rectified pixels only."""
    size = image_size_of(fields)
    _refuse_part_of_sensor(fields, size)
    matrix = camera_matrix(fields, _first(fields, ("camera_matrix", "K", "k")), size)
    coefficients = _first(fields, ("distortion_coefficients", "D", "d"))
    return _distorted_lens(fields, "distortion_model", coefficients, matrix)


def camodocal_lens(fields: Fields) -> Lens:
    """The lens of a camodocal fisheye or pinhole: its k2 to k5 are OpenCV's k1 to k4, its mu and mv pixels a radian."""
    size = image_size_of(fields)
    if fields.text("model_type") == "KANNALA_BRANDT":
        numbers = fields.below("projection_parameters")
        focal = (numbers.positive("mu"), numbers.positive("mv"))
        centre = (numbers.number("u0"), numbers.number("v0"))
        require_inside(numbers, "u0", centre, size)
        k = (1.0, *(numbers.number(key) for key in ("k2", "k3", "k4", "k5")))
        return KannalaBrandt(k, focal, centre, size)
    if fields.text("model_type") == "PINHOLE":
        numbers, terms = fields.below("projection_parameters"), fields.below("distortion_parameters")
        centre = (numbers.number("cx"), numbers.number("cy"))
        require_inside(numbers, "cx", centre, size)
        matrix = CameraMatrix((numbers.positive("fx"), numbers.positive("fy")), centre, size)
        d = tuple(terms.number(key) for key in ("k1", "k2", "p1", "p2"))
        return distorted_lens(terms, "plumb_bob", keys=("model_type", "p1"), d=d, matrix=matrix)
    raise fields.refusal(
        "model_type",
        "KANNALA_BRANDT, PINHOLE or MEI; calibrate again: "
        "intrinsic_calib -i PICTURES -p PREFIX -w COLUMNS -h ROWS -s SQUARE_MM --camera-model kannala-brandt",
    )


def opencv_lens(fields: Fields) -> Lens:
    """The lens of OpenCV matrices with a model's name: the four numbers alone fit a fisheye and a pinhole alike."""
    named = next((key for key in MODEL_KEYS if key in fields), None)
    if named is None:
        raise fields.refusal(
            "model",
            "a model: line of fisheye, plumb_bob or rational_polynomial next to the matrices, which do not name it",
        )
    matrix = camera_matrix(fields, _first(fields, OPENCV_MATRIX_KEYS), image_size_of(fields))
    return _distorted_lens(fields, named, _first(fields, OPENCV_DISTORTION_KEYS), matrix)


def require_inside(fields: Fields, key: str, pixel: tuple[float, float], image_size: tuple[int, int]) -> None:
    """Refuse a principal point outside the image: it is of another image, or in other units."""
    (u, v), (width, height) = pixel, image_size
    if not (-0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5):
        raise fields.refusal(key, f"a principal point inside the image of {width} x {height} pixels")


def camera_matrix(fields: Fields, key: str, image_size: tuple[int, int]) -> CameraMatrix:
    """The camera matrix of nine numbers, row by row."""
    fx, fxy, cx, zero, fy, cy, *last = fields.numbers(key, 9)
    if fx <= 0.0 or fy <= 0.0 or zero or last != [0.0, 0.0, 1.0]:
        raise fields.refusal(key, "[fx, skew, cx, 0, fy, cy, 0, 0, 1] with positive fx and fy")
    require_inside(fields, key, (cx, cy), image_size)
    return CameraMatrix((fx, fy), (cx, cy), image_size, fxy / fx)


def distorted_lens(
    fields: Fields, model: str, *, keys: tuple[str, str], d: tuple[float, ...], matrix: CameraMatrix
) -> Lens:
    """The lens of a model with its coefficients. ``keys``: those of the model and the coefficients, for refusals.

    InputFileError where these numbers are not those of a lens: they are another model's.
    """
    model_key, d_key = keys
    lens: KannalaBrandt | BrownConrady
    if model in FISHEYE_NAMES:
        lens = KannalaBrandt((1.0, *d), matrix.focal, matrix.principal_point, matrix.image_size, skew=matrix.skew)
    else:
        d = (*d, *(0.0,) * (4 - len(d)))
        if model in ("plumb_bob", "radtan"):
            require_pinhole_terms(fields, d_key, model_key, d)
        lens = BrownConrady(matrix.focal, matrix.principal_point, d, matrix.image_size, skew=matrix.skew)
    require_field_of_view(fields, d_key if model_key == "lensmodel" else _matrix_key(fields), lens)
    require_monotonic(fields, d_key, lens)
    return lens


def _distorted_lens(fields: Fields, model_key: str, coefficients_key: str, matrix: CameraMatrix) -> Lens:
    """The lens of the model that ``model_key`` names, with the numbers under ``coefficients_key``."""
    model = "fisheye" if fields.is_true(model_key) else "plumb_bob" if fields.is_false(model_key) else ""
    model = model or fields.text(model_key).lower().removeprefix("opencv_")
    counts: tuple[int, ...] = (4,)
    if model in FISHEYE_NAMES:
        model = "fisheye"
    elif model in PINHOLE_COUNTS:
        counts = PINHOLE_COUNTS[model]
    else:
        raise fields.refusal(model_key, ", ".join((*FISHEYE_NAMES, *PINHOLE_COUNTS)))
    d = fields.numbers_with_zeros(coefficients_key, *counts)
    return distorted_lens(fields, model, keys=(model_key, coefficients_key), d=d, matrix=matrix)


def _matrix_key(fields: Fields) -> str:
    return _first(fields, (*OPENCV_MATRIX_KEYS, "k", "intrinsics"))


def image_size_of(fields: Fields) -> tuple[int, int]:
    """The image size under any of the tools' keys."""
    for key in ("image_size", "imageSize"):
        if key in fields:
            return fields.size(key)
    for width, height in SIZE_KEYS:
        if width in fields:
            return fields.whole_pixels(width), fields.whole_pixels(height)
    raise fields.refusal("image_width", "image_width and image_height in whole pixels")


def _first(fields: Fields, keys: tuple[str, ...]) -> str:
    return next((key for key in keys if key in fields), keys[0])


def _refuse_part_of_sensor(fields: Fields, size: tuple[int, int]) -> None:
    """Refuse binning and a region of interest: they change the pixels and leave the numbers as they are."""
    for key in ("binning_x", "binning_y"):
        if key in fields and fields.number(key) not in (0.0, 1.0):
            raise fields.refusal(key, "0 or 1: a calibration of the pixels as they come")
    if "roi" in fields:
        roi = fields.below("roi")
        for key, whole in (("x_offset", 0), ("y_offset", 0), ("width", size[0]), ("height", size[1])):
            if key in roi and roi.number(key) not in (0.0, whole):
                raise roi.refusal(key, "0: a calibration of the whole image")
