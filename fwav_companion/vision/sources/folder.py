"""A folder of pictures that another program fills, with ``stamps.jsonl``: one line per picture, in order.

``{"file": "000017.png", "time_monotonic": 1234.567890, "frame": 17, "exposure_s": 0.004}``. The program writes a
picture before its line. The file of lines is followed as it grows, and reopened if it was replaced. A malformed line,
or one whose picture cannot be read, is skipped: later ones may be good.
"""

from __future__ import annotations

import logging
import os
import time
from pathlib import Path
from typing import BinaryIO

from fwav_companion.errors import InputFileError
from fwav_companion.pixels import read_pixels
from fwav_companion.vision.images import Picture, Pixels, SourceLostError, exposure_of, number_of, parse_line, stamp_of

_log = logging.getLogger(__name__)
STAMPS_FILE = "stamps.jsonl"
LOOK_S = 0.02
"""Interval of the checks for new lines."""


class FolderSource:
    """Follows the lines of a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            self._lines: BinaryIO = (folder / STAMPS_FILE).open("rb")
        except OSError as error:
            needed = 'a folder needs it, with a line per picture: {"file": "0.png", "time_unix": 1790000001.25}'
            raise SourceLostError(f"{folder / STAMPS_FILE}: {error.strerror}; {needed}") from None
        self._inode = os.fstat(self._lines.fileno()).st_ino
        self._begun = b""
        self._complained = False

    def read(self, timeout_s: float) -> Picture | None:
        """The picture of the next good line."""
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
        """The picture of one line; None if the line is not usable, which is logged once."""
        try:
            return self._read(line)
        except SourceLostError as error:
            if not self._complained:
                self._complained = True
                _log.warning("%s: skipped; further ones are skipped without a message", error)
            return None

    def _read(self, line: bytes) -> Picture:
        what = str(self._folder / STAMPS_FILE)
        described = parse_line(line, what)
        pixels = self._pixels(described.get("file"))
        return Picture(pixels, stamp_of(described, what), number_of(described), exposure_of(described))

    def close(self) -> None:
        """Close the file of lines."""
        self._lines.close()

    def _line(self) -> bytes | None:
        """The next complete line."""
        self._begun += self._lines.readline()
        if not self._begun.endswith(b"\n"):
            return None
        line, self._begun = self._begun, b""
        return line

    def _pixels(self, name: object) -> Pixels:
        path = self._folder / Path(str(name)).name  # no line can name a file outside of the folder
        try:
            return read_pixels(path, as_stored=False)
        except InputFileError as error:
            raise SourceLostError(str(error)) from None

    def _replaced(self) -> bool:
        """Whether the file of lines was removed, replaced or truncated."""
        try:
            now = (self._folder / STAMPS_FILE).stat()
        except OSError:
            return True
        return now.st_ino != self._inode or now.st_size < self._lines.tell()
