"""Recorded pictures with the Unix time of their exposure: a folder with stamps, photographs, or a video."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import cv2
import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import content
from fwav_companion.recording.folder import PICTURES, STAMPS
from fwav_companion.tools.detect.photo_metadata import PhotoMetadata, read_metadata
from fwav_companion.vision.images import (
    Picture,
    SourceLostError,
    exposure_of,
    number_of,
    parse_line,
    stamp_of,
)
from fwav_companion.vision.sources.folder import STAMPS_FILE

SUFFIXES: Final = {".jpeg", ".jpg", ".png", ".tif", ".tiff"}
WANTED_START: Final = (
    "give the first picture's time with its zone, as --start 2026-05-01T09:30:00+02:00 (or ...Z for UTC)"
)


class RecordedPictures(msgspec.Struct, frozen=True, kw_only=True):
    """Pictures in their order."""

    count: int
    """Number of pictures."""
    pictures: Iterator[Picture]
    poses: list[Mapping[str, float]]
    """Poses of those read until now, by the rows of a file of poses."""


def parse_start(text: str) -> datetime:
    """A time in ISO 8601 with its zone. InputFileError without one."""
    try:
        start = datetime.fromisoformat(text)
    except ValueError:
        start = None
    if start is None or start.tzinfo is None:
        raise InputFileError(f"--start {text}: accepted: ISO 8601 with a zone, as 2026-05-01T09:30:00+02:00 or ...Z")
    return start


def recorded_pictures(path: Path, start: datetime | None) -> RecordedPictures:
    """The pictures of a folder, recording, file or video. InputFileError where they, or their times, are missing."""
    path = folder_of(path)
    if path.is_dir():
        return _stamped(path) if (path / STAMPS_FILE).is_file() else _photographs(_files(path), start)
    if not path.is_file():
        raise InputFileError(f"{path}: no such file; accepted: a folder of pictures, a picture, or a video")
    return _photographs([path], start) if path.suffix.lower() in SUFFIXES else _video(path, start)


def folder_of(path: Path) -> Path:
    """The folder of kept pictures if the path is a recording with such a folder; otherwise the path."""
    return path / PICTURES if (path / STAMPS).is_file() else path


def _files(folder: Path) -> list[Path]:
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    if not files:
        raise InputFileError(f"{folder}: no pictures in it; accepted: {', '.join(sorted(SUFFIXES))}")
    return files


def _stamped(folder: Path) -> RecordedPictures:
    """A folder with ``stamps.jsonl``, as the folder source has it."""
    text = content(folder / STAMPS_FILE)
    lines = text.splitlines()
    if lines and not text.endswith((b"\n", b"}")):  # a power cut may leave an incomplete line
        del lines[-1]

    def read() -> Iterator[Picture]:
        for number, line in enumerate(lines, start=1):
            where = f"{folder / STAMPS_FILE}: line {number}"
            try:
                described = parse_line(line, where)
                stamp = stamp_of(described, where)
            except SourceLostError as error:
                raise InputFileError(str(error)) from None
            file = folder / Path(str(described.get("file"))).name
            yield Picture(_pixels(file), stamp, number_of(described), exposure_of(described))

    return RecordedPictures(count=len(lines), pictures=read(), poses=[])


def _photographs(files: list[Path], start: datetime | None) -> RecordedPictures:
    metadata = [read_metadata(file) for file in files]
    times = _times(files, metadata, start)
    order = sorted(range(len(files)), key=lambda i: times[i])
    poses: list[Mapping[str, float]] = []

    def read() -> Iterator[Picture]:
        for number, i in enumerate(order):
            pose = metadata[i].pose
            if pose is not None:
                poses.append({"frame": number, **pose})
            yield Picture(_pixels(files[i]), {"time_unix": round(times[i], 6)}, number, metadata[i].exposure_s)

    return RecordedPictures(count=len(files), pictures=read(), poses=poses)


def _times(files: list[Path], metadata: list[PhotoMetadata], start: datetime | None) -> list[float]:
    """Unix times; with ``start`` by the camera's clock from the first picture on."""
    if start is not None:
        local = [each.local for each in metadata]
        if len(files) == 1:
            return [start.timestamp()]
        for file, time in zip(files, local, strict=True):
            if time is None:
                raise InputFileError(f"{file}: no time in its EXIF; accepted: pictures with one, or {STAMPS_FILE}")
        known = [time for time in local if time is not None]
        return [start.timestamp() + (time - min(known)).total_seconds() for time in known]
    for file, each in zip(files, metadata, strict=True):
        if each.utc_s is None:
            raise InputFileError(f"{file}: its EXIF has neither a time with a zone nor GPS time; {WANTED_START}")
    return [each.utc_s for each in metadata if each.utc_s is not None]


def _video(path: Path, start: datetime | None) -> RecordedPictures:
    """A video's frames, by its own times counted from ``start``."""
    if start is None:
        raise InputFileError(f"{path}: a video has no time of day; {WANTED_START}")
    capture: Any = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise InputFileError(f"{path}: not a video or picture that OpenCV reads")

    def read() -> Iterator[Picture]:
        number = 0
        while True:
            ok, pixels = capture.read()
            if not ok:
                break
            at_s = start.timestamp() + capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            yield Picture(pixels, {"time_unix": round(at_s, 6)}, number)
            number += 1
        capture.release()
        if number == 0:
            raise InputFileError(f"{path}: no frame of it can be read")

    return RecordedPictures(count=max(1, int(capture.get(cv2.CAP_PROP_FRAME_COUNT))), pictures=read(), poses=[])


def _pixels(path: Path) -> Any:
    """The picture as the sensor has it: a rotation that the file only notes is not applied, as none is in flight."""
    pixels = cv2.imread(str(path), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION) if path.is_file() else None
    if pixels is None:
        raise InputFileError(f"{path}: not a readable picture")
    return pixels
