"""Recorded pictures with the Unix time of their exposure: a folder with stamps, photographs, or a video."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any, Final, TypeAlias

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import content
from fwav_companion.photographs.exif_tags import EXPOSURE, local_time, utc_time
from fwav_companion.photographs.files import read_tags
from fwav_companion.photographs.klv import TimeScale
from fwav_companion.photographs.picture_pose import AltDatum, NoPose, PicturePose, with_angles
from fwav_companion.photographs.pose_from_tags import pose_from_tags
from fwav_companion.photographs.poses_table import pose_row
from fwav_companion.photographs.table_poses import with_pose_of_table
from fwav_companion.photographs.tags import PictureTags, finite_number
from fwav_companion.pixels import read_pixels
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


class PoseOptions(msgspec.Struct, frozen=True, kw_only=True):
    """What the user says about the poses."""

    alt_datum: AltDatum | None = None
    """Of the absolute altitudes; None: by the tags."""
    takeoff_alt_m: float | None = None
    """Above EGM96, metres; None: not known."""
    angles_deg: tuple[float, float, float] | None = None
    """Roll, pitch and yaw of the camera, where the tags or the telemetry have none."""
    table: Mapping[str, PicturePose | NoPose] | None = None
    """Poses by the pictures' names, in place of those of the tags."""
    klv_time: TimeScale = TimeScale.AUTO
    """What the time of MISB metadata counts."""

    def row(self, file: str, pose: PicturePose | NoPose, size: tuple[int, int]) -> dict[str, str | float | int] | None:
        """The row of a file of poses; None where there is no pose, or no altitude."""
        row = pose_row(file, pose, size, self.alt_datum) if isinstance(pose, PicturePose) else None
        return row if row is None or self.takeoff_alt_m is None else {**row, "takeoff_alt": self.takeoff_alt_m}


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
    poses: PoseOptions | None = None,
    timed: bool = True,
) -> RecordedPictures:
    """The pictures of a folder, recording, file or video. InputFileError where they, or their times, are missing.

    ``poses``: None where they are not wanted. ``timed``: whether times of day matter. Without, a photograph may have
    its number as the time, and a video counts from 0.
    """
    path = folder_of(path)
    if path.is_dir():
        if (path / STAMPS_FILE).is_file():
            return _stamped(path, poses)
        return _photographs(_files(path), start, poses, timed=timed)
    if not path.is_file():
        raise InputFileError(f"{path}: no such file; accepted: a folder of pictures, a picture, or a video")
    if path.suffix.lower() in SUFFIXES:
        return _photographs([path], start, poses, timed=timed)
    from fwav_companion.tools.detect.recorded_video import recorded_video

    return recorded_video(path, start, poses, timed=timed)


def pose_rows(path: Path, start: datetime | None, options: PoseOptions) -> tuple[int, Iterator[PoseRow | None]]:
    """The number of pictures, and their poses in the order of their times where all have one, else of their names.

    Each picture gives a None beside its pose: a step of the work. InputFileError where there are no pictures.
    """
    path = folder_of(path)
    if not path.exists():
        raise InputFileError(f"{path}: no such file; accepted: a folder of pictures, a picture, or a video")
    if path.is_file() and path.suffix.lower() not in SUFFIXES:
        from fwav_companion.tools.detect.recorded_video import video_pose_rows

        return video_pose_rows(path, start, options)
    files = _files(path) if path.is_dir() else [path]

    def read() -> Iterator[PoseRow | None]:
        found = []
        for file in files:
            tags = read_tags(file)
            found.append((utc_time(tags), _row(file, tags, options)))
            yield None
        if all(time is not None for time, _ in found):
            found.sort(key=lambda each: each[0] or 0.0)
        for number, (time, row) in enumerate(found):
            if row is not None:
                yield {"frame": number, **({} if time is None else {"time_unix": round(time, 6)}), **row}

    return len(files), read()


def _row(file: Path, tags: PictureTags, options: PoseOptions) -> dict[str, str | float | int] | None:
    pose = pose_from_tags(tags)
    if options.table is not None:
        pose = with_pose_of_table(pose, file.name, options.table)
    pose = with_angles(pose, options.angles_deg)
    return options.row(file.name, pose, tags.size)


def folder_of(path: Path) -> Path:
    """The folder of kept pictures if the path is a recording with such a folder; otherwise the path."""
    return path / PICTURES if (path / STAMPS).is_file() else path


def picture_files(path: Path) -> list[Path]:
    """The pictures of a folder, a recording or a path of one. InputFileError where there are none."""
    path = folder_of(path)
    return _files(path) if path.is_dir() else [path]


def _files(folder: Path) -> list[Path]:
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    if not files:
        raise InputFileError(f"{folder}: no pictures in it; accepted: {', '.join(sorted(SUFFIXES))}")
    return files


def _stamped(folder: Path, poses: PoseOptions | None) -> RecordedPictures:
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
            row = None if poses is None else _row(file, read_tags(file), poses)
            if row is not None:
                key: dict[str, float] = {name: value for name, value in stamp.items() if name == "time_unix"}
                rows.append({**key, **({} if frame is None else {"frame": frame}), **row})
            yield Picture(_pixels(file), stamp, frame, exposure_of(described), file=file.name)

    return RecordedPictures(count=len(lines), pictures=read(), poses=rows)


def _photographs(
    files: list[Path], start: datetime | None, options: PoseOptions | None, *, timed: bool
) -> RecordedPictures:
    facts = [_facts(file, options) for file in files]
    has_times = start is not None or all(each.utc_s is not None for each in facts)
    times = _times(files, facts, start) if timed or has_times else list(map(float, range(len(files))))
    order = sorted(range(len(files)), key=lambda i: times[i])
    poses: list[PoseRow] = []

    def read() -> Iterator[Picture]:
        for number, i in enumerate(order):
            stamp, row = {"time_unix": round(times[i], 6)}, facts[i].row
            if row is not None:
                poses.append({"frame": number, **(stamp if timed or has_times else {}), **row})
            yield Picture(_pixels(files[i]), stamp, number, facts[i].exposure_s, file=files[i].name)

    return RecordedPictures(count=len(files), pictures=read(), poses=poses)


class _Facts(msgspec.Struct, frozen=True):
    """What is kept of a photograph's tags, which are large."""

    utc_s: float | None
    local: datetime | None
    exposure_s: float | None
    row: dict[str, str | float | int] | None


def _facts(file: Path, options: PoseOptions | None) -> _Facts:
    tags = read_tags(file)
    return _Facts(
        utc_time(tags),
        local_time(tags),
        finite_number(tags.exif.get(EXPOSURE)),
        None if options is None else _row(file, tags, options),
    )


def _times(files: list[Path], facts: list[_Facts], start: datetime | None) -> list[float]:
    """Unix times; with ``start`` by the camera's clock from the first picture on."""
    if start is not None:
        local = [each.local for each in facts]
        if len(files) == 1:
            return [start.timestamp()]
        for file, time in zip(files, local, strict=True):
            if time is None:
                raise InputFileError(f"{file}: no time in its EXIF; accepted: pictures with one, or {STAMPS_FILE}")
        known = [time for time in local if time is not None]
        return [start.timestamp() + (time - min(known)).total_seconds() for time in known]
    times = [each.utc_s for each in facts]
    for file, time_s in zip(files, times, strict=True):
        if time_s is None:
            raise InputFileError(f"{file}: its EXIF has neither a time with a zone nor GPS time; {WANTED_START}")
    return [time_s for time_s in times if time_s is not None]


def _pixels(path: Path) -> Any:
    """The picture as the sensor has it: a rotation that the file only notes is not applied, as none is in flight."""
    return read_pixels(path, as_stored=True)
