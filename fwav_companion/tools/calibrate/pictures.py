"""What the command line names, as grey pictures of one size: files, folders of them, a video.

Pictures come as the sensor has them: a turn that a phone or camera only notes in the file (EXIF) is not carried out,
since the frames of the flight will not be turned either.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Final, TypeAlias

import cv2
import msgspec
import numpy as np

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import content, opened
from fwav_companion.tools.calibrate.boards.finder import Grey
from fwav_companion.tools.calibrate.video import frame_count, sharpest

ACCEPTED: Final = "accepted: pictures, a folder of them, or a video"
SUFFIXES: Final = {".bmp", ".jpeg", ".jpg", ".jp2", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp"}
"""By which a folder's pictures are known from what else lies there. A file that is named may be called anything."""
JPEG, JPEG_SCAN, JPEG_END = b"\xff\xd8", b"\xff\xda", b"\xff\xd9"
"""Markers (ITU-T T.81, table B.1); compressed data never holds them."""
MOST_PICTURES: Final = 200
"""More show nothing new, and each takes a good part of a second."""

Look: TypeAlias = Callable[[], Grey]
Watched: TypeAlias = Callable[[str, int], AbstractContextManager[Callable[[], None]]]
"""Of work with so many steps: what is to be called after each."""


class Shot(msgspec.Struct, frozen=True):
    """One picture, not yet read."""

    name: str
    """For people: the file, or the video and the frame's number."""
    look: Look
    """InputFileError where it cannot be read."""


def silence() -> None:
    """Libraries' own complaints would stand between the lines: what cannot be read is told once, by us."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


def shots(names: Sequence[str], watched: Watched) -> tuple[list[Shot], str]:
    """Each once, in the order given, a folder's by name; and what was left out, in words.

    InputFileError for what is not there or no picture.
    """
    files = list(dict.fromkeys(file for name in names for file in _files(Path(name))))
    videos = [file for file in files if not cv2.haveImageReader(str(file))]
    if not videos:
        taken = _evenly(files, MOST_PICTURES)
        left_out = f"of {len(files)} pictures {len(taken)} are looked at, evenly" if len(taken) < len(files) else ""
        return [Shot(str(file), _reader(file)) for file in taken], left_out
    if len(files) > 1:
        raise InputFileError(f"{videos[0]}: no picture that can be read; {ACCEPTED}, alone")
    return _from_video(videos[0], watched)


def _from_video(video: Path, watched: Watched) -> tuple[list[Shot], str]:
    count = frame_count(video)
    with watched("reading the video", count) as on_frame:
        sharp, frames = sharpest(video, count, on_frame)
    if not sharp:
        raise InputFileError(f"{video}: no picture or video that can be read; {ACCEPTED}")
    taken = [Shot(f"{video}, frame {number}", _held(grey)) for number, grey in sharp]
    left_out = f"of {frames} frames the sharpest of each of {len(taken)} pieces is looked at"
    return taken, left_out if len(taken) < frames else ""


def _held(grey: Grey) -> Look:
    return lambda: grey


def same_size(taken: Sequence[Shot], show: Callable[[Shot, Grey], None]) -> tuple[int, int]:
    """Show each picture once; width and height of all. InputFileError where one is of another size."""
    size: tuple[int, int] | None = None
    for shot in taken:
        grey = shot.look()
        height, width = grey.shape
        if size is None:
            size = (width, height)
        elif size != (width, height):
            wanted = f"{size[0]} x {size[1]} as {taken[0].name}"
            raise InputFileError(f"{shot.name}: {width} x {height} pixels; accepted: {wanted}, all of one camera mode")
        show(shot, grey)
    if size is None:
        raise InputFileError(f"no picture; {ACCEPTED}")
    return size


def _files(path: Path) -> Iterator[Path]:
    try:
        if not path.is_dir():
            with opened(path):
                yield path
            return
        inside = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; {ACCEPTED}") from None
    if not inside:
        raise InputFileError(f"{path}: no picture in this folder; {ACCEPTED}")
    yield from inside


def _reader(file: Path) -> Look:
    def look() -> Grey:
        try:
            data = content(file)
        except OSError as error:
            raise InputFileError(f"{file}: {error.strerror}; {ACCEPTED}") from None
        grey = None if _is_cut_short(data) else _decoded(data)
        if grey is None:
            raise InputFileError(f"{file}: a picture that is damaged, or too large; {ACCEPTED}")
        return grey

    return look


def _decoded(data: bytes) -> Grey | None:
    """None where it is no picture. Decoders write what they think into stderr itself, so that is shut meanwhile."""
    stderr = os.dup(2)
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        grey = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:  # more pixels than OpenCV takes
        return None
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
    return None if grey is None else np.asarray(grey, dtype=np.uint8)


def _is_cut_short(data: bytes) -> bool:
    """A JPEG whose last scan has no end: its decoder would fill the rest with grey, and say so in lines of its own."""
    return data.startswith(JPEG) and data.rfind(JPEG_END) < data.rfind(JPEG_SCAN)


def _evenly(files: list[Path], most: int) -> list[Path]:
    """At most so many, the first and the last among them."""
    if len(files) <= most:
        return files
    return [files[round(i * (len(files) - 1) / (most - 1))] for i in range(most)]
