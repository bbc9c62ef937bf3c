"""SHELL: the clicks of a page in a file that is written after every click, and opened again with the pictures.

It is the CSV of `--pixels`, so that the command line answers for it too.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from fwav_companion.errors import InputFileError
from fwav_companion.on_disk import content, whole
from fwav_companion.tools.locate.clicks import PictureClick, parse_clicks

NAME: Final = "locate-clicks.csv"
HEADER: Final = ("file", "u", "v", "label")
ADVICE: Final = "accepted: a folder that can be written, or --pixels FILE"


class ClickFile:
    """One file of clicks."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> list[PictureClick]:
        """The clicks so far. InputFileError where the file is not one of clicks, or cannot be written again."""
        if not self.path.exists():
            self.write([])
        try:
            text = content(self.path).decode()
        except UnicodeDecodeError as error:
            raise InputFileError(f"{self.path}: byte {error.start} is not UTF-8; accepted: a text file") from None
        except OSError as error:
            raise InputFileError(f"{self.path}: {error.strerror}; accepted: a readable file") from None
        if text.strip() in ("", ",".join(HEADER)):
            return []
        return parse_clicks(text, str(self.path))

    def write(self, clicks: Sequence[PictureClick]) -> None:
        """Write all clicks; the old file remains where that fails. InputFileError."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(HEADER)
        writer.writerows((each.file, f"{each.pixel[0]:.2f}", f"{each.pixel[1]:.2f}", each.label) for each in clicks)
        try:
            with whole(self.path, synced=True) as file:
                file.write(text.getvalue().encode())
        except OSError as error:
            raise InputFileError(f"{self.path}: {error.strerror}; {ADVICE}") from None
