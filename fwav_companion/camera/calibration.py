"""Calibration files of five kinds, told apart by their content and never by guess."""

from __future__ import annotations

import re
from typing import Any

import msgspec

from fwav_companion.camera import tool_files
from fwav_companion.camera.fields import Fields
from fwav_companion.camera.native import MODEL, native_lens
from fwav_companion.errors import InputFileError
from fwav_companion.geometry.vectors import Matrix3
from fwav_companion.types import Lens

LONGEST_FILE_CHARACTERS = 1_000_000
"""A camchain of eight cameras has 6000."""
ACCEPTED = (
    "a file with model: kannala_brandt, a Kalibr camchain, a ROS camera_info, a camodocal file, or an OpenCV "
    "FileStorage with a model: beside its matrices"
)


class Calibration(msgspec.Struct, frozen=True):
    """What a calibration file says."""

    lens: Lens
    time_offset_s: float | None = None
    """By the sign of [camera] time_offset_s: positive where stamps come late. None: the file does not say."""
    body_from_camera: Matrix3 | None = None
    """None: the file does not say, or not in body axes."""
    note: str = ""
    """What was left out, for the log."""

    @property
    def image_size(self) -> tuple[int, int]:
        """Width, height in pixels."""
        return self.lens.image_size


def parse_calibration(text: str, name: str, *, imu_is_frd: bool = False) -> Calibration:
    """The calibration in ``text``; ``name`` is the file's, for complaints. InputFileError says what is wrong.

    ``imu_is_frd``: the user says that the IMU of a Kalibr file has the body's axes, as ``imu_axes: FRD`` in it would.
    """
    fields = Fields(_document(text, name), name)
    try:
        return _read(fields, imu_is_frd)
    except ValueError as error:  # numbers that are each in order but together no lens
        raise InputFileError(f"{name}: {error}") from error


def _read(fields: Fields, imu_is_frd: bool) -> Calibration:
    if "model_type" in fields:
        return Calibration(tool_files.camodocal_lens(fields))
    if "intrinsics" in fields or any(re.fullmatch(r"cam\d+", key) for key in fields):
        return _kalibr(fields, imu_is_frd)
    if "distortion_model" in fields:
        return Calibration(tool_files.ros_lens(fields))
    if any(key in fields for key in tool_files.OPENCV_MATRIX_KEYS):
        return Calibration(tool_files.opencv_lens(fields))
    if "model" in fields and fields.text("model") != MODEL:
        raise fields.refusal("model", f"{MODEL}, or another model's name beside OpenCV's matrices")
    if "model" in fields:
        return Calibration(native_lens(fields))
    raise InputFileError(f"{fields.name}: the keys {', '.join(list(fields)[:6])} stand there; {ACCEPTED} is accepted")


def _kalibr(fields: Fields, imu_is_frd: bool) -> Calibration:
    camera = tool_files.kalibr_camera(fields)
    for place in (fields, camera):
        if "imu_axes" in place:
            if place.text("imu_axes") != "FRD":
                raise place.refusal("imu_axes", "FRD (x forward, y right, z down) or no such key")
            imu_is_frd = True
    told = "T_cam_imu" in camera
    return Calibration(
        tool_files.kalibr_lens(camera),
        tool_files.kalibr_time_offset_s(camera),
        tool_files.kalibr_mount(camera) if told and imu_is_frd else None,
        "" if imu_is_frd or not told else "T_cam_imu is not used: add imu_axes: FRD if its IMU has the body's axes",
    )


def _document(text: str, name: str) -> dict[str, Any]:
    """The keys and values of YAML or JSON, with OpenCV's dialect of both; nothing in it is ever executed."""
    import yaml  # here: a relay without a camera never needs it

    class Loader(yaml.SafeLoader):
        """OpenCV's matrices are mappings with a tag."""

    def plain_mapping(loader: Loader, node: yaml.MappingNode) -> dict[Any, Any]:
        return loader.construct_mapping(node, deep=True)

    for tag in ("opencv-matrix", "opencv-nd-matrix"):
        Loader.add_constructor(f"tag:yaml.org,2002:{tag}", plain_mapping)
    if len(text) > LONGEST_FILE_CHARACTERS:
        raise InputFileError(f"{name}: {len(text)} characters stand there; {ACCEPTED} is accepted")
    if text.startswith("%YAML"):  # OpenCV's own spelling of the directive is no YAML
        text = text.partition("\n")[2]
    try:
        document = yaml.load(text, Loader=Loader)  # noqa: S506 - a SafeLoader
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputFileError(f"{name}: {' '.join(str(error).split())[:200]}; {ACCEPTED} is accepted") from error
    if not isinstance(document, dict) or not all(isinstance(key, str) for key in document):
        raise InputFileError(f"{name}: no keys and values stand there; {ACCEPTED} is accepted")
    return document
