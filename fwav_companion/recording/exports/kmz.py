"""SHELL: KMZ for Google Earth: the KML document, with the picture of each target's last sight in its description."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import Final

from fwav_companion.recording.exports.kml import KmlExport
from fwav_companion.recording.line_types import Line, TargetLine

FIRST_DATE: Final = (1980, 1, 1, 0, 0, 0)
"""Date of every entry, the earliest of zip: the same recording gives the same bytes."""


class KmzExport(KmlExport):
    """The zip file. ``pictures``: paths of the recording's pictures by frame number."""

    def __init__(self, path: PurePath, pictures: Mapping[int, Path] | None = None) -> None:
        super().__init__(path)
        self._pictures = pictures or {}
        self._sight: dict[int, int] = {}

    def add(self, line: Line) -> None:
        """Note the newest picture with a fix of each target, too."""
        super().add(line)
        if not isinstance(line, TargetLine) or line.frame is None or line.fix is None:
            return
        if line.is_confirmed and line.frame in self._pictures:
            self._sight[line.track] = line.frame

    def picture_of(self, track: int) -> str:
        """The name of a track's picture in the file; "" where there is none."""
        frame = self._sight.get(track)
        return "" if frame is None else f"pictures/{self._pictures[frame].name}"

    def content(self) -> bytes:
        """The zip file."""
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(zipfile.ZipInfo("doc.kml", FIRST_DATE), super().content(), zipfile.ZIP_DEFLATED)
            for frame in sorted(set(self._sight.values())):
                picture = self._pictures[frame]
                archive.writestr(zipfile.ZipInfo(f"pictures/{picture.name}", FIRST_DATE), picture.read_bytes())
        return packed.getvalue()
