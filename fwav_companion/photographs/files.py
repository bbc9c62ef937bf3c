"""SHELL: opens a picture and returns its tags, its pose and its lens."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import open_regular
from fwav_companion.photographs.exif_tags import stated_size
from fwav_companion.photographs.tags import PictureTags, xmp_values
from fwav_companion.pixels import largest_picture

EXIF_IFD, GPS_IFD = 0x8769, 0x8825
XMP_BEGIN, XMP_END = b"<x:xmpmeta", b"</x:xmpmeta>"
MOST_XMP = 1 << 20
"""Bytes at the start of a file that are searched for its XMP, which precedes the picture."""
SUFFIXES = (".jpeg", ".jpg", ".png", ".tif", ".tiff", ".dng")


def read_tags(path: Path) -> PictureTags:
    """The tags of a picture; its pixels are not decoded. InputFileError where it is not a picture."""
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = None  # the limit is ours, and its line says what is accepted
    try:
        with open_regular(path) as file, warnings.catch_warnings(), _pixels_uncounted(Image):
            warnings.simplefilter("ignore")  # Pillow's about sizes and broken tags: the answer is one line or none
            with Image.open(file) as image:
                size = image.size
                exif = image.getexif()
                packet = image.info.get("xmp")
                main, own, gps = dict(exif), dict(exif.get_ifd(EXIF_IFD)), dict(exif.get_ifd(GPS_IFD))
            if not isinstance(packet, bytes):
                packet = _searched(file)
    except OSError as error:
        reason = error.strerror or "not a picture"
        raise InputFileError(f"{path}: {reason}; accepted: a JPEG, PNG or TIFF picture") from None
    except Exception:  # noqa: BLE001  # Pillow raises errors of many kinds for broken files
        raise InputFileError(f"{path}: a broken picture; accepted: a JPEG, PNG or TIFF picture") from None
    most = largest_picture()
    if most is not None and size[0] * size[1] > most:
        limit = f"at most {most // 10**6} Mpx, more with --large"
        raise InputFileError(f"{path}: {size[0]} x {size[1]} pixels; accepted: {limit}")
    return PictureTags(size=size, xmp=xmp_values(packet.decode("utf-8", "replace")), exif={**main, **own}, gps=gps)


@contextmanager
def _pixels_uncounted(library: Any) -> Iterator[None]:
    """Pillow refuses to open pictures of 179 Mpx and more, for the cost of decoding: here no pixel is decoded."""
    most, library.MAX_IMAGE_PIXELS = library.MAX_IMAGE_PIXELS, None
    try:
        yield
    finally:
        library.MAX_IMAGE_PIXELS = most


def _searched(file: BinaryIO) -> bytes:
    """The XMP packet at the start of a file, wherever its maker put it; empty where there is none."""
    file.seek(0)
    head = file.read(MOST_XMP)
    begin = head.find(XMP_BEGIN)
    return head[begin : head.find(XMP_END, begin) + len(XMP_END)] if begin >= 0 else b""


def with_stated_size(tags: PictureTags) -> PictureTags:
    """The tags as if the picture had the size that its EXIF states: for pictures that stand for larger ones."""
    size = stated_size(tags)
    return tags if size is None else msgspec.structs.replace(tags, size=size)
