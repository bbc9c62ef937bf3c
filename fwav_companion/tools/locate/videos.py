"""SHELL: frames of a video as photographs: its size, the telemetry beside it, the lens, the pose at each time."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import radians, tan
from pathlib import Path
from typing import Any

import msgspec

from fwav_companion.camera import BrownConrady
from fwav_companion.errors import InputFileError
from fwav_companion.photographs.picture_pose import NoPose
from fwav_companion.photographs.telemetry_rows import FILM_WIDTH_MM, TelemetryRow
from fwav_companion.photographs.video_poses import pose_at
from fwav_companion.photographs.video_telemetry import video_telemetry
from fwav_companion.tools.locate.photographs import GIVEN_FIELD_SIGMA, CameraOptions, Photograph

VIDEO_SUFFIXES = (".mp4", ".mov", ".avi", ".mkv", ".ts", ".mpg", ".mpeg", ".m2ts")
VIDEO_FOCAL_SIGMA = 0.07
"""One sigma of the subtitle's focal length times zoom: video modes crop the sensor."""


def video_photographs(path: Path, times_s: Sequence[float], options: CameraOptions) -> list[Photograph]:
    """One photograph for each time of the video, named ``VIDEO@SECONDS``. InputFileError says what is missing."""
    size, length_s = _size_and_length(path)
    telemetry = video_telemetry(path, length_s)
    found = [_photograph(path, at_s, size, length_s, telemetry.rows, options) for at_s in times_s]
    said = (f"telemetry by {telemetry.source}", *telemetry.notes)
    return [msgspec.structs.replace(each, notes=(*each.notes, *said)) for each in found]


def video_length_s(path: Path) -> float:
    """The length of a video, seconds. InputFileError where it is none."""
    return _size_and_length(path)[1]


def video_frame(path: Path, at_s: float) -> Any:
    """The pixels of the frame at a time. InputFileError where there is none."""
    import cv2

    capture: Any = cv2.VideoCapture(str(path))
    try:
        capture.set(cv2.CAP_PROP_POS_MSEC, 1000.0 * at_s)
        good, pixels = capture.read()
    finally:
        capture.release()
    if not good:
        raise InputFileError(f"{path}: no picture at {at_s:.3f} s")
    return pixels


def frame_name(path: Path, at_s: float) -> str:
    """Name of a frame of a video."""
    return f"{path.name}@{at_s:.3f}"


def parse_time(text: str) -> float:
    """Seconds of H:M:S, M:S or S. InputFileError otherwise."""
    if re.fullmatch(r"(\d{1,4}:){0,2}\d{1,6}(\.\d{1,6})?", text) is None:
        raise InputFileError(f"--at {text}: accepted: a time of the video, as 00:01:23.4")
    seconds = 0.0
    for part in text.split(":"):
        seconds = seconds * 60.0 + float(part)
    return seconds


def _size_and_length(path: Path) -> tuple[tuple[int, int], float]:
    import cv2

    capture: Any = cv2.VideoCapture(str(path))
    try:
        if not capture.isOpened():
            raise InputFileError(f"{path}: not a video with pictures that OpenCV reads")
        size = (int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)))
        rate, frames = capture.get(cv2.CAP_PROP_FPS), capture.get(cv2.CAP_PROP_FRAME_COUNT)
    finally:
        capture.release()
    if min(size) <= 0 or not rate > 0.0:
        raise InputFileError(f"{path}: it has no stream of pictures; accepted: a video")
    return size, frames / rate


def _photograph(
    path: Path,
    at_s: float,
    size: tuple[int, int],
    length_s: float,
    rows: Sequence[TelemetryRow],
    options: CameraOptions,
) -> Photograph:
    if at_s > length_s:
        raise InputFileError(f"--at {at_s:g}: {path} ends at {length_s:.1f} s")
    pose = pose_at(rows, at_s, options.angles_deg)
    if isinstance(pose, NoPose):
        raise InputFileError(f"{path}: {pose.reason}")
    name, notes = Path(frame_name(path, at_s)), pose.notes
    if options.calibration is not None:
        if options.calibration.image_size != size:
            raise InputFileError(f"{path}: {size[0]} x {size[1]} pixels, --camera is for another size")
        lens, sigma, source = options.calibration.lens, 0.0, "lens by --camera"
    else:
        focal, sigma, source = _focal(path, at_s, size, rows, options)
        lens = BrownConrady((focal, focal), ((size[0] - 1) / 2.0, (size[1] - 1) / 2.0), (), size)
    return Photograph(
        path=name,
        size=size,
        orientation=1,
        pose=pose,
        lens=lens,
        focal_sigma=sigma,
        notes=(*notes, source),
    )


def _focal(
    path: Path, at_s: float, size: tuple[int, int], rows: Sequence[TelemetryRow], options: CameraOptions
) -> tuple[float, float, str]:
    """(focal length in pixels, its relative sigma, where it is from)."""
    if options.hfov_deg is not None:
        return 0.5 * size[0] / tan(0.5 * radians(options.hfov_deg)), GIVEN_FIELD_SIGMA, "focal length by --hfov"
    row = min(rows, key=lambda each: abs(each.at_s - at_s))
    if row.focal_35mm is None:
        raise InputFileError(f"{path}: its telemetry has no focal length; give --hfov DEG or --camera FILE")
    focal = size[0] * row.focal_35mm / FILM_WIDTH_MM
    return focal, VIDEO_FOCAL_SIGMA, f"focal length by the telemetry, within {VIDEO_FOCAL_SIGMA:.0%}"
