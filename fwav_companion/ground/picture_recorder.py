"""SHELL: records the changes of the picture once a second as JSON lines, which `--replay` plays."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from fwav_companion import __version__
from fwav_companion.errors import InputFileError
from fwav_companion.ground.picture import GroundPicture

PERIOD_S = 1.0
MAX_BYTES = 2_000_000_000
"""Largest size of a recording: about a day of a hundred vehicles."""


class PictureRecorder:
    """Writes one recording."""

    def __init__(self, folder: str, picture: GroundPicture, now: float) -> None:
        """InputFileError where the folder cannot be written to."""
        self._picture = picture
        name = datetime.fromtimestamp(now, UTC).strftime("ground-%Y%m%dT%H%M%SZ.jsonl")
        self.path = Path(folder) / name
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self.path.open("xb")
        except OSError as error:
            raise InputFileError(f"{self.path}: {error.strerror}; accepted: a folder to write to") from None
        self._encoder = msgspec.json.Encoder()
        self._revision, self._due_unix, self._bytes, self._works = 0, now, 0, True

    def start(self) -> None:
        """Write the first line."""
        self._write({"type": "header", "schema": 1, "version": __version__, "unix_offset_s": 0.0, "origin": None})
        self._picture.on_source(str(self.path), works=True, text="recording")

    def tick(self, now: float) -> None:
        """Write what changed, once a second."""
        if now < self._due_unix or not self._works:
            return
        self._due_unix = now + PERIOD_S
        update = self._picture.update_since(self._revision, now)
        self._revision = update.revision
        self._write({"type": "picture", "time_unix": now, "update": update})

    def close(self) -> None:
        """End the recording."""
        self._file.close()

    def _write(self, line: dict[str, Any]) -> None:
        """Append a line. A full disk stops the recording, not the program."""
        data = self._encoder.encode(line) + b"\n"
        self._bytes += len(data)
        try:
            if self._bytes > MAX_BYTES:
                raise OSError(0, "it has its largest size")
            self._file.write(data)
            self._file.flush()
        except OSError as error:
            self._works = False
            self._picture.on_source(str(self.path), works=False, text=f"recording stopped: {error.strerror}")
