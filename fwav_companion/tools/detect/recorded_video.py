"""SHELL: a recorded video: its frames with their times, and the poses by the telemetry that belongs to it."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import cv2

from fwav_companion.errors import InputFileError
from fwav_companion.photographs.video_poses import pose_at
from fwav_companion.photographs.video_telemetry import VideoTelemetry, video_telemetry
from fwav_companion.tools.detect.recorded_pictures import WANTED_START, PoseOptions, PoseRow, RecordedPictures
from fwav_companion.vision.images import Picture


def recorded_video(
    path: Path, start: datetime | None, options: PoseOptions | None, *, timed: bool = True
) -> RecordedPictures:
    """A video's frames, by its own times counted from ``start``, else from the UTC of its telemetry.

    InputFileError where it is no video, or where times of day matter and there are none.
    """
    capture = _open_video(path)
    telemetry = None if options is None else _telemetry(path, capture, options)
    begin_s = _begin_s(path, start, telemetry, timed=timed)
    poses: list[PoseRow] = []

    def read() -> Iterator[Picture]:
        for number, at_s, pixels in _frames(path, capture, decoded=True):
            stamp = {"time_unix": round(begin_s + at_s, 6)}
            if telemetry is not None and options is not None:
                size = (int(pixels.shape[1]), int(pixels.shape[0]))
                row = _pose(path, telemetry, at_s, size, options)
                if row is not None:
                    poses.append({"frame": number, **stamp, **row})
            yield Picture(pixels, stamp, number)

    return RecordedPictures(count=max(1, int(capture.get(cv2.CAP_PROP_FRAME_COUNT))), pictures=read(), poses=poses)


def video_pose_rows(path: Path, start: datetime | None, options: PoseOptions) -> tuple[int, Iterator[PoseRow | None]]:
    """The number of frames, and their poses; a None beside each: a step of the work."""
    capture = _open_video(path)
    telemetry = _telemetry(path, capture, options)
    begin_s = _begin_s(path, start, telemetry, timed=False)
    size = (int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)))

    def read() -> Iterator[PoseRow | None]:
        for number, at_s, _ in _frames(path, capture, decoded=False):
            yield None
            row = _pose(path, telemetry, at_s, size, options)
            if row is not None:
                yield {"frame": number, "time_unix": round(begin_s + at_s, 6), **row}

    return max(1, int(capture.get(cv2.CAP_PROP_FRAME_COUNT))), read()


def _open_video(path: Path) -> Any:
    capture: Any = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise InputFileError(f"{path}: not a video or picture that OpenCV reads")
    return capture


def _frames(path: Path, capture: Any, *, decoded: bool) -> Iterator[tuple[int, float, Any]]:
    """(number, seconds of the video, pixels) of each frame; pixels are None where they are not wanted."""
    number = 0
    while capture.grab():
        at_s = capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        good, pixels = capture.retrieve() if decoded else (True, None)
        if not good:
            break
        yield number, at_s, pixels
        number += 1
    capture.release()
    if number == 0:
        raise InputFileError(f"{path}: no frame of it can be read")


def _telemetry(path: Path, capture: Any, options: PoseOptions) -> VideoTelemetry:
    rate = capture.get(cv2.CAP_PROP_FPS)
    length_s = capture.get(cv2.CAP_PROP_FRAME_COUNT) / rate if rate > 0.0 else 0.0
    telemetry = video_telemetry(path, length_s, options.klv_time)
    if options.angles_deg is None and all(row.angles_deg is None for row in telemetry.rows):
        raise InputFileError(f"{path}: {telemetry.source} has no camera angles; give --angles ROLL,PITCH,YAW")
    return telemetry


def _begin_s(path: Path, start: datetime | None, telemetry: VideoTelemetry | None, *, timed: bool) -> float:
    """Unix time of the video's beginning; 0 where it is not known and does not matter."""
    if start is not None:
        return start.timestamp()
    known = None if telemetry is None else telemetry.start_unix()
    if known is None and timed:
        raise InputFileError(f"{path}: a video has no time of day; {WANTED_START}")
    return known or 0.0


def _pose(
    path: Path, telemetry: VideoTelemetry, at_s: float, size: tuple[int, int], options: PoseOptions
) -> dict[str, str | float | int] | None:
    return options.row(path.name, pose_at(telemetry.rows, at_s, options.angles_deg), size)
