"""A folder of pictures that some other program fills, and its ``stamps.jsonl``: one line a picture, in order.

``{"file": "000017.png", "time_monotonic": 1234.567890, "frame": 17, "exposure_s": 0.004}``. A picture is written before
its line; the file of lines is followed as it grows, and begun anew where it was replaced. A line that is none, or whose
picture cannot be read, is passed over: those behind it may be whole.
"""

from __future__ import annotations

import logging
import os
import time
from pathlib import Path
from typing import BinaryIO

import cv2

from fwav_companion.vision.images import Picture, Pixels, SourceLostError
from fwav_companion.vision.sources.stamps import exposure_of, number_of, parse_line, stamp_of

_log = logging.getLogger(__name__)
STAMPS_FILE = "stamps.jsonl"
LOOK_S = 0.02
"""A folder does not tell of new files: how often it is looked at."""


class FolderSource:
    """Follows the lines."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            self._lines: BinaryIO = (folder / STAMPS_FILE).open("rb")
        except OSError as error:
            needed = 'a folder needs it, with a line a picture: {"file": "0.png", "time_unix": 1790000001.25}'
            raise SourceLostError(f"{folder / STAMPS_FILE}: {error.strerror}; {needed}") from None
        self._inode = os.fstat(self._lines.fileno()).st_ino
        self._begun = b""
        self._complained = False

    def read(self, timeout_s: float) -> Picture | None:
        """The picture of the next line that has one."""
        deadline = time.monotonic() + timeout_s
        while True:
            line = self._line()
            picture = None if line is None else self._picture(line)
            if picture is not None:
                return picture
            if line is None and self._replaced():
                raise SourceLostError(f"{self._folder / STAMPS_FILE}: replaced or removed")
            if time.monotonic() >= deadline:
                return None
            if line is None:
                time.sleep(LOOK_S)

    def _picture(self, line: bytes) -> Picture | None:
        """Of one line; None where it is of no use, which is told once."""
        try:
            return self._read(line)
        except SourceLostError as error:
            if not self._complained:
                self._complained = True
                _log.warning("%s: passed over, as others like it will be", error)
            return None

    def _read(self, line: bytes) -> Picture:
        what = str(self._folder / STAMPS_FILE)
        told = parse_line(line, what)
        return Picture(self._pixels(told.get("file")), stamp_of(told, what), number_of(told), exposure_of(told))

    def close(self) -> None:
        """Let go of the file."""
        self._lines.close()

    def _line(self) -> bytes | None:
        """The next line that is whole."""
        self._begun += self._lines.readline()
        if not self._begun.endswith(b"\n"):
            return None
        line, self._begun = self._begun, b""
        return line

    def _pixels(self, name: object) -> Pixels:
        path = self._folder / Path(str(name)).name  # whatever a line says, nothing outside of the folder is opened
        pixels = cv2.imread(str(path), cv2.IMREAD_COLOR) if path.is_file() else None
        if pixels is None:
            raise SourceLostError(f"{path}: no picture that can be read")
        read: Pixels = pixels
        return read

    def _replaced(self) -> bool:
        """By another file, or by nothing: written anew from its beginning."""
        try:
            now = (self._folder / STAMPS_FILE).stat()
        except OSError:
            return True
        return now.st_ino != self._inode or now.st_size < self._lines.tell()
