"""Recorded pictures with the Unix time of their exposure: a folder with stamps, photographs, or a video."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, TypeAlias

import cv2
import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import content
from fwav_companion.photographs.exif_tags import EXPOSURE, local_time, utc_time
from fwav_companion.photographs.files import read_tags
from fwav_companion.photographs.picture_pose import AltDatum, PicturePose
from fwav_companion.photographs.pose_from_tags import pose_from_tags
from fwav_companion.photographs.poses_table import pose_row
from fwav_companion.photographs.tags import PictureTags, finite_number
from fwav_companion.recording.folder import PICTURES, STAMPS
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


PoseRow: TypeAlias = Mapping[str, str | float | int]


class RecordedPictures(msgspec.Struct, frozen=True, kw_only=True):
    """Pictures in their order."""

    count: int
    """Number of pictures."""
    pictures: Iterator[Picture]
    poses: list[PoseRow]
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


def recorded_pictures(
    path: Path,
    start: datetime | None,
    *,
    poses: bool = False,
    alt_datum: AltDatum | None = None,
    timed: bool = True,
) -> RecordedPictures:
    """The pictures of a folder, recording, file or video. InputFileError where they, or their times, are missing.

    ``poses``: also of pictures with stamps, whose tags are not needed otherwise.
    ``timed``: whether times of day matter. Without, a photograph has its number as the time, and a video counts from 0.
    """
    if not timed and start is None:
        start = datetime.fromtimestamp(0.0, UTC)
    path = folder_of(path)
    if path.is_dir():
        if (path / STAMPS_FILE).is_file():
            return _stamped(path, poses, alt_datum)
        return _photographs(_files(path), start, alt_datum, timed=timed)
    if not path.is_file():
        raise InputFileError(f"{path}: no such file; accepted: a folder of pictures, a picture, or a video")
    return (
        _photographs([path], start, alt_datum, timed=timed) if path.suffix.lower() in SUFFIXES else _video(path, start)
    )


def pose_rows(path: Path, alt_datum: AltDatum | None = None) -> tuple[int, Iterator[PoseRow | None]]:
    """The number of pictures, and their poses in the order of their times where all have one, else of their names.

    A picture without a pose gives None. InputFileError where there are no pictures.
    """
    path = folder_of(path)
    if not path.exists():
        raise InputFileError(f"{path}: no such file; accepted: a folder of pictures, or a picture")
    files = _files(path) if path.is_dir() else [path]

    def read() -> Iterator[PoseRow | None]:
        found = []
        for file in files:
            tags = read_tags(file)
            found.append((utc_time(tags), _row(file, tags, alt_datum)))
            yield None
        if all(time is not None for time, _ in found):
            found.sort(key=lambda each: each[0] or 0.0)
        for number, (time, row) in enumerate(found):
            if row is not None:
                yield {"frame": number, **({} if time is None else {"time_unix": round(time, 6)}), **row}

    return len(files), read()


def _row(file: Path, tags: PictureTags, alt_datum: AltDatum | None) -> dict[str, str | float | int] | None:
    pose = pose_from_tags(tags)
    return pose_row(file.name, pose, tags.size, alt_datum) if isinstance(pose, PicturePose) else None


def folder_of(path: Path) -> Path:
    """The folder of kept pictures if the path is a recording with such a folder; otherwise the path."""
    return path / PICTURES if (path / STAMPS).is_file() else path


def _files(folder: Path) -> list[Path]:
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    if not files:
        raise InputFileError(f"{folder}: no pictures in it; accepted: {', '.join(sorted(SUFFIXES))}")
    return files


def _stamped(folder: Path, poses: bool, alt_datum: AltDatum | None) -> RecordedPictures:
    """A folder with ``stamps.jsonl``, as the folder source has it."""
    text = content(folder / STAMPS_FILE)
    lines = text.splitlines()
    if lines and not text.endswith((b"\n", b"}")):  # a power cut may leave an incomplete line
        del lines[-1]

    rows: list[PoseRow] = []

    def read() -> Iterator[Picture]:
        for number, line in enumerate(lines, start=1):
            where = f"{folder / STAMPS_FILE}: line {number}"
            try:
                described = parse_line(line, where)
                stamp = stamp_of(described, where)
            except SourceLostError as error:
                raise InputFileError(str(error)) from None
            file = folder / Path(str(described.get("file"))).name
            frame = number_of(described)
            row = _row(file, read_tags(file), alt_datum) if poses else None
            if row is not None:
                key: dict[str, float] = {name: value for name, value in stamp.items() if name == "time_unix"}
                rows.append({**key, **({} if frame is None else {"frame": frame}), **row})
            yield Picture(_pixels(file), stamp, frame, exposure_of(described), file=file.name)

    return RecordedPictures(count=len(lines), pictures=read(), poses=rows)


def _photographs(
    files: list[Path], start: datetime | None, alt_datum: AltDatum | None, *, timed: bool
) -> RecordedPictures:
    metadata = [read_tags(file) for file in files]
    times = _times(files, metadata, start) if timed else list(map(float, range(len(files))))
    order = sorted(range(len(files)), key=lambda i: times[i])
    poses: list[PoseRow] = []

    def read() -> Iterator[Picture]:
        for number, i in enumerate(order):
            stamp = {"time_unix": round(times[i], 6)}
            row = _row(files[i], metadata[i], alt_datum)
            if row is not None:
                poses.append({"frame": number, **stamp, **row})
            exposure_s = finite_number(metadata[i].exif.get(EXPOSURE))
            yield Picture(_pixels(files[i]), stamp, number, exposure_s, file=files[i].name)

    return RecordedPictures(count=len(files), pictures=read(), poses=poses)


def _times(files: list[Path], metadata: list[PictureTags], start: datetime | None) -> list[float]:
    """Unix times; with ``start`` by the camera's clock from the first picture on."""
    if start is not None:
        local = [local_time(each) for each in metadata]
        if len(files) == 1:
            return [start.timestamp()]
        for file, time in zip(files, local, strict=True):
            if time is None:
                raise InputFileError(f"{file}: no time in its EXIF; accepted: pictures with one, or {STAMPS_FILE}")
        known = [time for time in local if time is not None]
        return [start.timestamp() + (time - min(known)).total_seconds() for time in known]
    times = [utc_time(each) for each in metadata]
    for file, time_s in zip(files, times, strict=True):
        if time_s is None:
            raise InputFileError(f"{file}: its EXIF has neither a time with a zone nor GPS time; {WANTED_START}")
    return [time_s for time_s in times if time_s is not None]


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
