"""The files, folders or the video of the command line, as grey pictures of one size.

Pictures come as the sensor has them. A rotation that a phone or camera only notes in the file (EXIF) is not applied,
because the frames of the flight will not be rotated either. Of a video the sharpest frame of each piece is searched: a
moving hand blurs most of them. Of their views ``view_spread`` takes those that lie apart.
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
from fwav_companion.on_disk import content, open_regular
from fwav_companion.tools.calibrate.board_finders import Grey

ACCEPTED: Final = "accepted: pictures, a folder of them, or a video"
SUFFIXES: Final = {".bmp", ".jpeg", ".jpg", ".jp2", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp"}
"""Suffixes of a folder's pictures. A file that is named may have any suffix."""
JPEG, JPEG_SCAN, JPEG_END = b"\xff\xd8", b"\xff\xda", b"\xff\xd9"
"""Markers (ITU-T T.81, table B.1); compressed data never contains them."""
MOST_PICTURES: Final = 200
"""Most pictures that are used: more add little, and each takes a good part of a second."""
VIDEO_PIECES: Final = 120
"""Number of pieces into which a video is divided; each gives its sharpest frame: two a second in a minute's video."""

ReadPicture: TypeAlias = Callable[[], Grey]
"""Reads a picture. InputFileError where it is unreadable."""
Watched: TypeAlias = Callable[[str, int], AbstractContextManager[Callable[[], None]]]
"""Progress of work with a number of steps: gives the function to call after each step."""


class CalibrationPicture(msgspec.Struct, frozen=True):
    """One picture, not yet read."""

    name: str
    """File, or video and frame number."""
    read: ReadPicture
    """Reads the picture."""
    of_video: bool = False
    """Whether it is a frame of a video, of which the program chooses."""


def silence_opencv() -> None:
    """Suppress the libraries' own messages: an unreadable picture is reported once, by this command."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


def pictures_of(names: Sequence[str], watched: Watched) -> tuple[list[CalibrationPicture], str]:
    """The pictures, each once, in the order given and a folder's by name; and a line about those left out, or "".

    InputFileError where a name is missing or is not a picture.
    """
    files = list(dict.fromkeys(file for name in names for file in _files(Path(name))))
    videos = [file for file in files if not cv2.haveImageReader(str(file))]
    if not videos:
        taken = _evenly(files, MOST_PICTURES)
        left_out = f"{len(taken)} of {len(files)} pictures are used, evenly spaced" if len(taken) < len(files) else ""
        return [CalibrationPicture(str(file), _reader(file)) for file in taken], left_out
    if len(files) > 1:
        raise InputFileError(f"{videos[0]}: not a readable picture; {ACCEPTED}, alone")
    return _from_video(videos[0], watched)


def same_size(
    pictures: Sequence[CalibrationPicture], show: Callable[[CalibrationPicture, Grey], None]
) -> tuple[int, int]:
    """Width and height of all pictures, each handed once to ``show``. InputFileError where one has another size."""
    size: tuple[int, int] | None = None
    for picture in pictures:
        grey = picture.read()
        height, width = grey.shape
        if size is None:
            size = (width, height)
        elif size != (width, height):
            wanted = f"{size[0]} x {size[1]} as {pictures[0].name}"
            raise InputFileError(
                f"{picture.name}: {width} x {height} pixels; accepted: {wanted}, all of one camera mode"
            )
        show(picture, grey)
    if size is None:
        raise InputFileError(f"no picture; {ACCEPTED}")
    return size


def sharpest_frames(video: Path, count: int, on_frame: Callable[[], None]) -> tuple[list[tuple[int, Grey]], int]:
    """The (number, frame) with the sharpest edges of each piece of ``count`` frames; and the number of frames read."""
    best: dict[int, tuple[float, int, Grey]] = {}
    frames = 0
    for number, grey in enumerate(_frames(video)):
        piece = min(number * VIDEO_PIECES // count, VIDEO_PIECES - 1)
        sharpness = float(cv2.Laplacian(grey, cv2.CV_64F).var())
        if piece not in best or sharpness > best[piece][0]:
            best[piece] = (sharpness, number, grey)
        frames = number + 1
        on_frame()
    return [(number, grey) for _, number, grey in best.values()], frames


def _from_video(video: Path, watched: Watched) -> tuple[list[CalibrationPicture], str]:
    count = _frame_count(video)
    with watched("reading the video", count) as on_frame:
        sharp, frames = sharpest_frames(video, count, on_frame)
    if not sharp:
        raise InputFileError(f"{video}: not a readable picture or video; {ACCEPTED}")
    taken = [CalibrationPicture(f"{video}, frame {number}", _held(grey), of_video=True) for number, grey in sharp]
    left_out = (
        f"{len(taken)} of {frames} frames are searched, the sharpest of each piece of the video; of their views those "
        "that lie apart are used"
    )
    return taken, left_out if len(taken) < frames else ""


def _frame_count(video: Path) -> int:
    """The number of frames by the file's header, at least one; some headers are wrong."""
    capture = cv2.VideoCapture(str(video))
    count = capture.get(cv2.CAP_PROP_FRAME_COUNT)
    capture.release()
    return int(count) if 1.0 <= count < 1e9 else 1


def _frames(video: Path) -> Iterator[Grey]:
    capture = cv2.VideoCapture(str(video))
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0.0)
    try:
        while True:
            ok, pixels = capture.read()
            if not ok:
                return
            yield np.asarray(pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    finally:
        capture.release()


def _held(grey: Grey) -> ReadPicture:
    return lambda: grey


def _files(path: Path) -> Iterator[Path]:
    try:
        if not path.is_dir():
            with open_regular(path):
                yield path
            return
        inside = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror}; {ACCEPTED}") from None
    if not inside:
        raise InputFileError(f"{path}: no picture in this folder; {ACCEPTED}")
    yield from inside


def _reader(file: Path) -> ReadPicture:
    def read() -> Grey:
        try:
            data = content(file)
        except OSError as error:
            raise InputFileError(f"{file}: {error.strerror}; {ACCEPTED}") from None
        grey = None if _is_cut_short(data) else _decoded(data)
        if grey is None:
            raise InputFileError(f"{file}: a damaged picture, or one too large; {ACCEPTED}")
        return grey

    return read


def _decoded(data: bytes) -> Grey | None:
    """The grey picture; None where the data is not one. stderr is closed meanwhile: decoders write to it themselves."""
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
    """Whether a JPEG's last scan has no end: its decoder would fill the rest with grey, and print a warning."""
    return data.startswith(JPEG) and data.rfind(JPEG_END) < data.rfind(JPEG_SCAN)


def _evenly(files: list[Path], most: int) -> list[Path]:
    """At most ``most`` files, evenly spaced, the first and the last among them."""
    if len(files) <= most:
        return files
    return [files[round(i * (len(files) - 1) / (most - 1))] for i in range(most)]
