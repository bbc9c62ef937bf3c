"""SHELL: reads the pixels of a picture file, of a size that is asked first."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from fwav_companion.errors import InputFileError
from fwav_companion.memory_limit import is_want_of_memory

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Pixels = NDArray[np.uint8]

LARGEST_PICTURE: Final = 200_000_000
"""Most pixels of a picture: twice those of the largest aerial camera, 100 Mpx. They are 600 MB in memory."""
PIXELS_VARIABLE: Final = "OPENCV_IO_MAX_IMAGE_PIXELS"
"""OpenCV's own limit: it reads the size from a file's header, and refuses before it decodes."""


def largest_picture() -> int | None:
    """Most pixels of a picture now; None: as many as fit."""
    stated = os.environ.get(PIXELS_VARIABLE, "")
    return int(stated) if stated.isdecimal() else None


def read_pixels(path: Path, *, as_stored: bool) -> Pixels:
    """The picture in colour. InputFileError in one line where it is none, or too large.

    ``as_stored``: a rotation that the file only notes is not applied.
    """
    import cv2

    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION if as_stored else cv2.IMREAD_COLOR
    try:
        pixels: Any = cv2.imread(str(path), flags) if path.is_file() else None
    except cv2.error as error:
        if is_want_of_memory(error):
            raise
        limit = f"{(largest_picture() or 1 << 30) // 10**6} Mpx"
        raise InputFileError(f"{path}: more than {limit}; accepted: at most {limit}, more with --large") from None
    if pixels is None:
        raise InputFileError(f"{path}: not a readable picture")
    return cast("Pixels", pixels)
