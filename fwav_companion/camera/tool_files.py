"""The calibration files of other tools: Kalibr, ROS, camodocal, OpenCV."""

from __future__ import annotations

import re

from fwav_companion.camera.fields import Fields
from fwav_companion.camera.intrinsics import CameraMatrix, camera_matrix, checked, distorted_lens
from fwav_companion.camera.kannala_brandt import KannalaBrandt
from fwav_companion.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix
from fwav_companion.geometry.vectors import IDENTITY3, Matrix3, multiply, transpose
from fwav_companion.types import Lens

OPENCV_MATRIX_KEYS = ("camera_matrix", "K", "cameraMatrix", "Camera_Matrix")
OPENCV_DISTORTION_KEYS = ("distortion_coefficients", "D", "distCoeffs", "dist_coeffs", "Distortion_Coefficients")
SIZE_KEYS = (("image_width", "image_height"), ("width", "height"), ("image_Width", "image_Height"))


def kalibr_camera(fields: Fields) -> Fields:
    """The one camera of a camchain."""
    cameras = [key for key in fields if re.fullmatch(r"cam\d+", key)]
    if len(cameras) > 1:
        raise fields.refusal(
            cameras[1], f"a chain of one camera: leave only the one that flies of {', '.join(cameras)}"
        )
    return fields.below(cameras[0]) if cameras else fields


def kalibr_lens(fields: Fields) -> Lens:
    """Of a pinhole with its distortion model; omni, ds and eucm are other projections."""
    if fields.text("camera_model") != "pinhole":
        raise fields.refusal("camera_model", "pinhole with distortion_model equidistant or radtan")
    fu, fv, pu, pv = fields.numbers("intrinsics", 4)
    if min(fu, fv) <= 0.0:
        raise fields.refusal("intrinsics", "[fu, fv, pu, pv] with positive fu and fv")
    matrix = CameraMatrix((fu, fv), (pu, pv), fields.size("resolution"))
    return distorted_lens(fields, "distortion_model", "distortion_coeffs", checked(fields, "intrinsics", matrix))


def kalibr_time_offset_s(fields: Fields) -> float | None:
    """Of stamps that come late: Kalibr's t_imu = t_cam + shift has the other sign."""
    return -fields.number("timeshift_cam_imu") if "timeshift_cam_imu" in fields else None


def kalibr_mount(fields: Fields) -> Matrix3:
    """body_from_camera, where the IMU's axes are the body's: T_cam_imu maps them into the camera's."""
    t = fields.numbers("T_cam_imu", 16)
    camera_from_imu: Matrix3 = ((t[0], t[1], t[2]), (t[4], t[5], t[6]), (t[8], t[9], t[10]))
    product = multiply(camera_from_imu, transpose(camera_from_imu))
    wrong = max(abs(product[i][j] - IDENTITY3[i][j]) for i in range(3) for j in range(3))
    (a, b, c), (d, e, f), (g, h, i) = camera_from_imu
    if wrong > 1e-3 or a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0.0:
        raise fields.refusal("T_cam_imu", "a 4x4 matrix that begins with a rotation")
    return transpose(matrix_from_quaternion(quaternion_from_matrix(camera_from_imu)))


def ros_lens(fields: Fields) -> Lens:
    """Of a camera_info, as a file or as a message: raw pixels, so its projection matrix has no part in it."""
    size = _image_size(fields)
    _refuse_part_of_sensor(fields, size)
    matrix = camera_matrix(fields, _first(fields, ("camera_matrix", "K", "k")), size)
    coefficients = _first(fields, ("distortion_coefficients", "D", "d"))
    return distorted_lens(fields, "distortion_model", coefficients, matrix)


def camodocal_lens(fields: Fields) -> Lens:
    """Its k2 to k5 are OpenCV's k1 to k4, its mu and mv pixels a radian: k1 is 1."""
    size = _image_size(fields)
    if fields.text("model_type") == "KANNALA_BRANDT":
        numbers = fields.below("projection_parameters")
        focal = (numbers.positive("mu"), numbers.positive("mv"))
        centre = (numbers.number("u0"), numbers.number("v0"))
        checked(numbers, "u0", CameraMatrix(focal, centre, size))
        k = (1.0, *(numbers.number(key) for key in ("k2", "k3", "k4", "k5")))
        return KannalaBrandt(k, focal, centre, size)
    raise fields.refusal("model_type", "KANNALA_BRANDT")


def opencv_lens(fields: Fields) -> Lens:
    """Of matrices that name no model themselves: four numbers fit a fisheye and a pinhole alike."""
    if "model" not in fields:
        raise fields.refusal(
            "model",
            "a model: line of fisheye, plumb_bob or rational_polynomial beside the matrices, which do not say it,",
        )
    matrix = camera_matrix(fields, _first(fields, OPENCV_MATRIX_KEYS), _image_size(fields))
    return distorted_lens(fields, "model", _first(fields, OPENCV_DISTORTION_KEYS), matrix)


def _image_size(fields: Fields) -> tuple[int, int]:
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
    """Binning and a region of interest change the pixels without changing the numbers."""
    for key in ("binning_x", "binning_y"):
        if key in fields and fields.number(key) not in (0.0, 1.0):
            raise fields.refusal(key, "0 or 1: a calibration of the pixels as they come,")
    if "roi" in fields:
        roi = fields.below("roi")
        for key, whole in (("x_offset", 0), ("y_offset", 0), ("width", size[0]), ("height", size[1])):
            if key in roi and roi.number(key) not in (0.0, whole):
                raise roi.refusal(key, "0: a calibration of the whole image")
