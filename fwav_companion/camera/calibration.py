"""Calibration files of nine kinds, distinguished by their content, and the project's own kind read here."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import radians

import msgspec

from fwav_companion.camera import more_tool_files, sphere_files, tool_files
from fwav_companion.camera.documents import document
from fwav_companion.camera.fields import Fields
from fwav_companion.camera.kannala_brandt import KannalaBrandt
from fwav_companion.errors import InputFileError
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.types import Lens

ACCEPTED = (
    "accepted: a file with model: kannala_brandt, a Kalibr camchain, a ROS camera_info, a camodocal file, a "
    ".cameramodel of mrcal, a gyroflow lens profile, Basalt's and OCamCalib's files, or an OpenCV FileStorage with a "
    "model: line next to its matrices"
)
ROS_MATRIX_KEYS = ("camera_matrix", "K", "k")
NATIVE_MODEL = "kannala_brandt"
NATIVE_KEYS = ("model", "image_size", "k_mm", "pixels_per_mm", "principal_point", "max_angle_deg")


class Calibration(msgspec.Struct, frozen=True):
    """The content of a calibration file."""

    lens: Lens
    """Lens model with its valid range."""
    time_offset_s: float | None = None
    """Delay of the stamps with the sign of [camera] time_offset_s, seconds; None where the file has no delay."""
    body_from_camera: Matrix3 | None = None
    """Mount rotation from the camera to body FRD; None where the file has no mount in body axes."""
    note: str = ""
    """What of the file was not used, for the log."""

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.lens.image_size


def file_and_camera(text: str) -> tuple[str, str]:
    """The file and the camera in it, as ("camchain.yaml", "cam1") of camchain.yaml#cam1; "" where none is named."""
    file, mark, camera = text.rpartition("#")
    return (file, camera) if mark and file and re.fullmatch(r"cam\d+", camera) else (text, "")


def parse_calibration(text: str, name: str, *, imu_is_frd: bool = False, camera: str = "") -> Calibration:
    """The calibration in ``text`` of the file ``name``. InputFileError names the key, its value and the fix.

    ``camera``: the camera of a Kalibr chain of several. ``imu_is_frd``: the IMU of a Kalibr file has the body's axes;
    ``imu_axes: FRD`` in the file has the same effect.
    """
    fields = Fields(document(text, name, ACCEPTED), name)
    try:
        return _read(fields, imu_is_frd, camera)
    except ValueError as error:  # each number is valid, but together they are not a lens
        raise InputFileError(f"{name}: {error}") from error


class FileKind(msgspec.Struct, frozen=True):
    """One kind of calibration file: how it is known by its keys, and its reader."""

    matches: Callable[[Fields], bool]
    read: Callable[[Fields, str, bool], Calibration]
    """Takes the fields, the name of the camera or "", and whether the IMU's axes are FRD."""
    has_cameras: bool = False
    """Whether one file has several cameras, each with a name."""


def _read(fields: Fields, imu_is_frd: bool, camera: str) -> Calibration:
    kind = next((kind for kind in KINDS if kind.matches(fields)), None)
    if kind is None:
        raise InputFileError(f"{fields.name}: its keys are {', '.join(list(fields)[:6])}; {ACCEPTED}")
    if camera and not kind.has_cameras:
        raise InputFileError(f"{fields.name}: it has one camera; accepted: the file's name without #{camera}")
    return kind.read(fields, camera, imu_is_frd)


def _is_chain(fields: Fields) -> bool:
    return any(key == "intrinsics" or re.fullmatch(r"cam\d+", key) for key in fields)


def _is_ros(fields: Fields) -> bool:
    return "distortion_model" in fields and any(key in fields for key in ROS_MATRIX_KEYS)


def _is_opencv(fields: Fields) -> bool:
    return any(key in fields for key in tool_files.OPENCV_MATRIX_KEYS)


def _has(key: str) -> Callable[[Fields], bool]:
    return lambda fields: key in fields


def _lens_alone(read: Callable[[Fields], Lens]) -> Callable[[Fields, str, bool], Calibration]:
    return lambda fields, _camera, _imu_is_frd: Calibration(read(fields))


def _basalt(fields: Fields, camera: str, _imu_is_frd: bool) -> Calibration:
    lens = sphere_files.basalt_lens(fields.below("value0"), camera)
    return Calibration(lens, note="T_imu_cam and cam_time_offset_ns are not used")


def _camodocal_lens(fields: Fields) -> Lens:
    if fields.text("model_type") == "MEI":
        return sphere_files.camodocal_mei_lens(fields, tool_files.image_size_of(fields))
    return tool_files.camodocal_lens(fields)


def _named_lens(fields: Fields) -> Lens:
    reader = LENS_READERS.get(fields.text("model"))
    if reader is None:
        accepted = " or ".join(LENS_READERS)
        raise fields.refusal("model", f"{accepted}, or another model's name next to OpenCV's matrices")
    return reader(fields)


def _native_lens(fields: Fields) -> KannalaBrandt:
    """The lens of the project's own file: the paper's constants by their names."""
    for key in fields:
        if key not in NATIVE_KEYS:
            raise fields.refusal(key, f"only {', '.join(NATIVE_KEYS)}")
    image_size = fields.size("image_size")
    k_mm = fields.numbers("k_mm", 1, 2, 3, 4, 5)
    if k_mm[0] <= 0.0:
        raise fields.refusal("k_mm", "a positive first coefficient")
    m_u, m_v = fields.numbers("pixels_per_mm", 2)
    if min(m_u, m_v) <= 0.0:
        raise fields.refusal("pixels_per_mm", "two positive numbers")
    u0, v0 = fields.numbers("principal_point", 2)
    tool_files.require_inside(fields, "principal_point", (u0, v0), image_size)
    max_angle = None
    if "max_angle_deg" in fields:
        max_angle = radians(fields.positive("max_angle_deg"))
        if max_angle > radians(180.0):
            raise fields.refusal("max_angle_deg", "an angle from the optical axis of at most 180 degrees")
    return KannalaBrandt(k_mm, (m_u, m_v), (u0, v0), image_size, max_angle=max_angle)


LENS_READERS: dict[str, Callable[[Fields], Lens]] = {NATIVE_MODEL: _native_lens}
"""Reader of the project's own camera file, by its ``model``."""


def _kalibr(fields: Fields, wanted: str, imu_is_frd: bool) -> Calibration:
    camera = tool_files.kalibr_camera(fields, wanted)
    for place in (fields, camera):
        if "imu_axes" in place:
            if place.text("imu_axes") != "FRD":
                raise place.refusal("imu_axes", "FRD (x forward, y right, z down), or no such key")
            imu_is_frd = True
    has_mount = "T_cam_imu" in camera
    is_sphere = "camera_model" in camera and camera.text("camera_model") in sphere_files.SPHERE_COUNTS
    return Calibration(
        sphere_files.kalibr_sphere_lens(camera) if is_sphere else tool_files.kalibr_lens(camera),
        tool_files.kalibr_time_offset_s(camera),
        tool_files.kalibr_mount(camera) if has_mount and imu_is_frd else None,
        ""
        if imu_is_frd or not has_mount
        else "T_cam_imu is not used: add imu_axes: FRD if its IMU has the body's axes",
    )


KINDS = (
    FileKind(_has("value0"), _basalt, has_cameras=True),
    FileKind(_has("ocamcalib"), _lens_alone(lambda fields: sphere_files.ocamcalib_lens(fields.below("ocamcalib")))),
    FileKind(_has("lensmodel"), _lens_alone(more_tool_files.mrcal_lens)),
    FileKind(_has("fisheye_params"), _lens_alone(more_tool_files.gyroflow_lens)),
    FileKind(_has("model_type"), _lens_alone(_camodocal_lens)),
    FileKind(_is_chain, _kalibr, has_cameras=True),
    FileKind(_is_ros, _lens_alone(tool_files.ros_lens)),
    FileKind(_is_opencv, _lens_alone(tool_files.opencv_lens)),
    FileKind(_has("model"), _lens_alone(_named_lens)),
)
"""The kinds of files, the most specific keys first."""
