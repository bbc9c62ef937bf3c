"""SHELL: the images of a page: files as they are, small ones for the strip, frames of a video."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Final, Protocol

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import content
from fwav_companion.tools.locate.photographs import CameraOptions, Photograph
from fwav_companion.tools.locate.videos import frame_name, video_frame, video_length_s, video_photographs

SHOWN_BY_BROWSERS: Final = {".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".png": "image/png"}
LARGEST_SHOWN: Final = 60_000_000
"""Most pixels of a picture that a browser gets as it is: a telephone decodes it into 240 MB."""
SMALLER_SIDE: Final = 6000
"""Longest side of the copy of a larger picture, pixels."""
SMALL_SIDE: Final = 240
"""Longest side of a picture of the strip."""
QUALITY: Final = 88
FIRST_FRAMES: Final = 12
"""Frames of a video in the strip at the start, at equal distances."""

Image = tuple[str, bytes]
"""MIME type and content."""


class PictureFacts(msgspec.Struct, frozen=True, kw_only=True):
    """A picture for the page."""

    file: str
    width: int
    """As viewers turn it, pixels."""
    height: int
    lat: float
    lon: float
    yaw_deg: float


class Shelf(Protocol):
    """Pictures by name."""

    video_s: float | None
    """Length of the video; None for photographs."""

    def photographs(self, named: Sequence[str]) -> Sequence[Photograph]:
        """All pictures to answer for: always the same ones, and the named frames. InputFileError for other names."""

    def image(self, file: str, *, small: bool) -> Image:
        """A picture. KeyError for a name that is not there; InputFileError where it cannot be read."""


class PhotographShelf:
    """Photographs of a folder."""

    def __init__(self, photographs: Sequence[Photograph]) -> None:
        self._photographs = {each.path.name: each for each in photographs}
        self.video_s: float | None = None

    def photographs(self, named: Sequence[str]) -> Sequence[Photograph]:
        """All of them."""
        del named
        return list(self._photographs.values())

    def image(self, file: str, *, small: bool) -> Image:
        """The file itself where a browser shows it, else a JPEG of it."""
        photograph = self._photographs[file]
        kind = SHOWN_BY_BROWSERS.get(photograph.path.suffix.lower())
        width, height = photograph.size
        if kind is not None and not small and width * height <= LARGEST_SHOWN:
            try:
                return kind, content(photograph.path)
            except OSError as error:
                raise InputFileError(f"{photograph.path}: {error.strerror}") from None
        return _reduced(photograph.path, SMALL_SIDE if small else SMALLER_SIDE)


class VideoShelf:
    """Frames of a video: some for the strip, and every one that is asked for."""

    def __init__(self, path: Path, options: CameraOptions) -> None:
        self._path, self._options = path, options
        self.video_s: float | None = video_length_s(path)
        self._strip = [frame_name(path, self.video_s * (i + 0.5) / FIRST_FRAMES) for i in range(FIRST_FRAMES)]
        self._made: dict[str, Photograph] = {}

    def photographs(self, named: Sequence[str]) -> Sequence[Photograph]:
        """The frames of the strip and the named ones, in the order of their times."""
        names = dict.fromkeys([*self._strip, *named])
        missing = [name for name in names if name not in self._made]
        if missing:
            times = [self._time(name) for name in missing]
            for name, photograph in zip(missing, video_photographs(self._path, times, self._options), strict=True):
                self._made[name] = photograph
        return [self._made[name] for name in sorted(names, key=self._time)]

    def image(self, file: str, *, small: bool) -> Image:
        """A frame as a JPEG."""
        return _frame(self._path, self._time(file), SMALL_SIDE if small else SMALLER_SIDE)

    def _time(self, name: str) -> float:
        stem, _, seconds = name.rpartition("@")
        try:
            at_s = float(seconds) if stem == self._path.name else -1.0
        except ValueError:
            at_s = -1.0
        if not 0.0 <= at_s <= (self.video_s or 0.0):
            raise InputFileError(f"{name}: not a frame of {self._path.name}")
        return at_s


def shown(photograph: Photograph) -> PictureFacts:
    """A picture's facts for the page."""
    width, height = photograph.viewed_size
    pose = photograph.pose
    return PictureFacts(
        file=photograph.path.name, width=width, height=height, lat=pose.lat_deg, lon=pose.lon_deg, yaw_deg=pose.yaw_deg
    )


def _reduced(path: Path, side: int) -> Image:
    from PIL import Image as Pictures
    from PIL import ImageOps

    try:
        with Pictures.open(path) as image:
            image.draft("RGB", (side, side))  # JPEG: decoded at an eighth of its size where that is enough
            image.thumbnail((side, side))
            turned = ImageOps.exif_transpose(image).convert("RGB")
    except Exception:  # noqa: BLE001  # Pillow raises errors of many kinds for broken files
        raise InputFileError(f"{path}: a broken picture") from None
    out = BytesIO()
    turned.save(out, "JPEG", quality=QUALITY)
    return "image/jpeg", out.getvalue()


def _frame(path: Path, at_s: float, side: int) -> Image:
    import cv2

    pixels = video_frame(path, at_s)
    scale = side / max(pixels.shape[:2])
    if scale < 1.0:
        pixels = cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    good, encoded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not good:
        raise InputFileError(f"{path}: the picture at {at_s:.3f} s cannot be encoded")
    return "image/jpeg", encoded.tobytes()
